//! `quest-cli view`, and the pages as a browser shows them.

use std::{fs, path::Path, process::Command};

use crate::{directory_with, example, run, run_in};

/// What a browser has to say of a page that is no fault of the page: how WebGL is emulated, and a hint at speed.
const HARMLESS: [&str; 3] =
    ["willReadFrequently", "GPU stall due to ReadPixels", "fallback to software WebGL"];

/// Switches every entry of every legend off and on, then says on the page that it got there.
const PROBE: &str = "<script>\
    for (const button of document.querySelectorAll('.legend button')) { button.click(); button.click(); }\
    document.title = document.querySelectorAll('.js-plotly-plot').length + ' plots, '\
      + document.querySelectorAll('.legend button').length + ' switches, '\
      + document.querySelectorAll('.gl-container canvas').length + ' canvases';\
    </script></body>";

fn browser() -> Option<&'static str> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    names
        .into_iter()
        .find(|name| Command::new(name).arg("--version").output().is_ok_and(|o| o.status.success()))
}

/// Opens the page in a browser without a window; returns its title after [`PROBE`] has run, and fails on what the
/// console says.
fn opened(page: &Path) -> String {
    let browser = browser().expect("Chromium, which scripts/test installs");
    let probed = page.with_extension("probed.html");
    let html = fs::read_to_string(page).unwrap();
    let end = html.rfind("</body>").unwrap();
    fs::write(&probed, format!("{}{PROBE}</html>", &html[..end])).unwrap();
    let profile = tempfile::tempdir().unwrap();
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader"])
        .args([
            "--enable-unsafe-swiftshader",
            "--ignore-gpu-blocklist",
            "--window-size=500,400",
            "--virtual-time-budget=2000",
        ])
        .args(["--enable-logging=stderr", "--v=0", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("file://{}", probed.display()))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    let console = said.lines().filter(|line| line.contains("CONSOLE"));
    let faults: Vec<_> = console.filter(|line| !HARMLESS.iter().any(|h| line.contains(h))).collect();
    assert!(faults.is_empty(), "{faults:#?}");
    let dom = String::from_utf8_lossy(&output.stdout);
    let title = dom.split("<title>").nth(1).and_then(|rest| rest.split("</title>").next());
    title.unwrap_or_default().to_owned()
}

#[test]
fn a_pair_becomes_a_page() {
    let directory = tempfile::tempdir().unwrap();
    for (name, solver) in [("points.json", "quest"), ("tiny_berlin_7in.json", "stewenius")] {
        let page = directory.path().join("view.html");
        let found = run_in(
            directory.path(),
            &["view", &example(name), "--all", "--quiet", "--solver", solver, "-o", "view.html"],
            b"",
        );
        assert_eq!((found.status, found.stdout.as_str(), found.stderr.as_str()), (0, "", ""));
        let html = fs::read_to_string(&page).unwrap();
        // What is ours begins behind plotly.js.
        let ours = &html[html.find("<h1>").unwrap()..];
        assert!(
            ours.contains("camera 1")
                && ours.contains("1 exact")
                && ours.contains("match 0<br>depths".replace('<', "\\u003c").as_str())
        );
        let candidates = ours.split("<tbody>").nth(1).unwrap().matches("<tr>").count();
        assert!(candidates > 1 && !ours.contains("NaN"));
    }
}

#[test]
fn an_estimate_becomes_a_page() {
    let directory = tempfile::tempdir().unwrap();
    for (name, model) in [("tumfr3_98072_98172.json", "general"), ("hololens_00011_00015.json", "planar")] {
        let given = example(name);
        let refused = run_in(directory.path(), &["view", &given, "--quiet", "-o", "view.html"], b"");
        assert_eq!(refused.status, 1);
        assert!(refused.stderr.contains("quest-cli view --estimate"), "{}", refused.stderr);
        let found =
            run_in(directory.path(), &["view", &given, "--estimate", "--quiet", "-o", "view.html"], b"");
        assert_eq!((found.status, found.stdout.as_str(), found.stderr.as_str()), (0, "", ""));
        let html = fs::read_to_string(directory.path().join("view.html")).unwrap();
        let ours = &html[html.find("<h1>").unwrap()..];
        let printed = run(&["estimate", &given, "--format", "json", "--quiet"]).stdout;
        let estimate: serde_json::Value = serde_json::from_str(&printed).unwrap();
        let count =
            format!("{} of {}", estimate["inlier_count"], estimate["inliers"].as_array().unwrap().len());
        for words in [
            &count,
            model,
            "outliers",
            "camera 1",
            "Matches over both images",
            "95 % of camera 2",
            "against the noise",
            "customdata",
        ] {
            assert!(ours.contains(words), "{name}: {words}");
        }
        assert_eq!(ours.contains("second pose"), !estimate["runner_up"].is_null());
    }
    let directory = directory_with("plane.csv", "x1,y1,x2,y2\n0,0,0,0\n");
    let found = run_in(directory.path(), &["view", "plane.csv", "--estimate", "-o", "view.html"], b"");
    assert_eq!(found.status, 2);
    assert!(run(&["view", "a.json", "--threshold", "1", "-o", "b.html"]).stderr.contains("--estimate"));
}

#[test]
#[ignore = "needs Chromium; scripts/test runs it"]
fn an_estimate_is_shown_in_a_browser() {
    let directory = tempfile::tempdir().unwrap();
    let given = example("hololens_00011_00015.json");
    let found = run_in(directory.path(), &["view", &given, "--estimate", "--quiet", "-o", "view.html"], b"");
    assert_eq!(found.status, 0, "{}", found.stderr);
    assert!(opened(&directory.path().join("view.html")).starts_with("5 plots"));
}

#[test]
#[ignore = "needs Chromium; scripts/test runs it"]
fn a_pair_is_shown_in_a_browser() {
    let directory = tempfile::tempdir().unwrap();
    let page = directory.path().join("view.html");
    let found = run_in(
        directory.path(),
        &["view", &example("points.json"), "--all", "--quiet", "-o", "view.html"],
        b"",
    );
    assert_eq!(found.status, 0, "{}", found.stderr);
    let html = fs::read_to_string(&page).unwrap();
    let candidates = html.rsplit("<tbody>").next().unwrap().matches("<tr>").count();
    // The scene and the residuals; a switch in each for each candidate up to nine, and for the others; one for each other camera.
    let switches = 2 * candidates.min(10) + 2;
    assert_eq!(opened(&page), format!("2 plots, {switches} switches, 1 canvases"));
}

#[test]
#[ignore = "needs Chromium; scripts/test runs it"]
fn figures_are_shown_in_a_browser() {
    let directory = tempfile::tempdir().unwrap();
    let page = directory.path().join("figures.html");
    let arguments = ["simulate", "--figure", "6", "--trials", "2", "--solvers", "quest,nister", "--quiet"];
    let found = run_in(directory.path(), &[&arguments[..], &["--plot", "figures.html"]].concat(), b"");
    assert_eq!(found.status, 0, "{}", found.stderr);
    assert_eq!(opened(&page), "6 plots, 2 switches, 0 canvases");
}

#[test]
#[ignore = "needs Chromium; scripts/test runs it"]
fn spheres_and_cameras_in_space_are_shown_in_a_browser() {
    let directory = tempfile::tempdir().unwrap();
    let page = directory.path().join("page.html");
    let found = run_in(directory.path(), &["figures", "-o", "page.html"], b"");
    assert_eq!((found.status, found.stderr.as_str()), (0, ""));
    let title = opened(&page);
    assert!(title.starts_with("11 plots, ") && title.ends_with("2 canvases"), "{title}");
    let found = run_in(directory.path(), &["servo", "--quiet", "--plot", "page.html"], b"");
    assert_eq!((found.status, found.stderr.as_str()), (0, ""));
    let title = opened(&page);
    assert!(title.starts_with("7 plots, ") && title.ends_with("1 canvases"), "{title}");
}

#[test]
fn cameras_and_points_become_ply() {
    let directory = tempfile::tempdir().unwrap();
    let ply = |arguments: &[&str]| {
        let run = run_in(directory.path(), &[&["view", "-o", "scene.ply"], arguments].concat(), b"");
        assert_eq!((run.status, run.stdout.as_str(), run.stderr.as_str()), (0, "", ""));
        fs::read_to_string(directory.path().join("scene.ply")).unwrap()
    };
    let count = |text: &str, what: &str| -> usize {
        let line = text.lines().find(|line| line.starts_with(&format!("element {what}"))).unwrap();
        line.rsplit(' ').next().unwrap().parse().unwrap()
    };
    let points = ply(&[&example("points.json")]);
    let (header, body) = points.split_once("end_header\n").unwrap();
    assert!(header.starts_with("ply\nformat ascii 1.0\n"), "{header}");
    let (vertices, edges) = (count(header, "vertex"), count(header, "edge"));
    assert_eq!(body.lines().count(), vertices + edges);
    assert!(body.lines().take(vertices).all(|line| line.split(' ').count() == 6));
    // The five points of the true pose are among the vertices; a depth is that of the candidate shown.
    let solved = run(&["solve", &example("points.json"), "--format", "json", "--quiet"]).stdout;
    let solved: serde_json::Value = serde_json::from_str(&solved).unwrap();
    let depths = solved["candidates"][0]["depths1"].as_array().unwrap();
    for depth in depths.iter().map(|z| z.as_f64().unwrap()) {
        let is_it =
            |line: &str| (line.split(' ').nth(2).unwrap().parse::<f64>().unwrap() - depth).abs() < 1e-9;
        assert!(body.lines().take(vertices).any(is_it), "{depth}");
    }
    let estimate = ply(&[&example("tumfr3_98072_98172.json"), "--estimate"]);
    assert!(count(&estimate, "vertex") > 300, "{}", &estimate[..400]);
    let other = run(&["view", &example("points.json"), "-o", "scene.obj"]);
    assert!(
        other.status == 2 && other.stderr.contains("a name that ends with .html or .ply"),
        "{}",
        other.stderr
    );
}

#[test]
fn without_a_pose_there_is_no_page() {
    let directory = tempfile::tempdir().unwrap();
    let line = "[[0,0,0,0],[0.1,0,0.1,0],[0.2,0,0.2,0],[0.3,0,0.3,0],[0.4,0,0.5,0]]";
    fs::write(directory.path().join("line.json"), format!("{{\"matches\": {line}}}")).unwrap();
    let found = run_in(directory.path(), &["view", "line.json", "-o", "view.html"], b"");
    assert_eq!(found.status, 1, "{}", found.stderr);
    assert!(found.stderr.contains("line.json") && !directory.path().join("view.html").exists());
    let found = run(&["view", "/no/such/file.json", "-o", "view.html"]);
    assert_eq!(found.status, 2);
    assert!(found.stderr.contains("/no/such/file.json"));
    assert_eq!(run(&["view", &example("points.json")]).status, 2, "a page needs a name");
}
