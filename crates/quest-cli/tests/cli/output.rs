//! Where results go, and what is left behind when they cannot.

use super::*;

/// The names of the files in a directory.
fn files(directory: &Path) -> Vec<String> {
    let entries = fs::read_dir(directory).unwrap();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_file_is_written_as_on_standard_output() {
    let directory = tempfile::tempdir().unwrap();
    let shown = run(&["solvers", "--no-times", "--format", "json"]);
    let run = run_in(directory.path(), &["solvers", "--no-times", "--format", "json", "-o", "out.txt"], b"");
    assert_eq!((run.status, run.stdout.as_str(), run.stderr.as_str()), (0, "", ""));
    assert_eq!(fs::read_to_string(directory.path().join("out.txt")).unwrap(), shown.stdout);
    assert_eq!(files(directory.path()), ["out.txt"]);
}

#[test]
fn the_extension_of_the_file_decides_the_format() {
    let directory = tempfile::tempdir().unwrap();
    for (file, start) in
        [("o.json", "[{\n"), ("o.jsonl", "{\"name\""), ("o.csv", "name,"), ("o.txt", "solver ")]
    {
        assert_eq!(run_in(directory.path(), &["solvers", "--no-times", "-o", file], b"").status, 0);
        let text = fs::read_to_string(directory.path().join(file)).unwrap();
        assert!(text.starts_with(start), "{file}: {text}");
    }
}

#[test]
fn the_shipped_examples_print_no_warnings() {
    for (command, file, more) in [
        ("solve", "points.json", &["--all"][..]),
        ("solve", "points.csv", &["--all"]),
        ("solve", "tiny_berlin_7in.json", &["--all"]),
        ("estimate", "tumfr3_98072_98172.json", &[]),
        ("estimate", "hololens_00011_00015.json", &[]),
    ] {
        let run = run(&[&[command, &example(file)], more].concat());
        assert_eq!((run.status, run.stderr.as_str()), (0, ""), "{command} {file}");
    }
}

#[test]
fn progress_is_told_where_it_is_asked_for() {
    let pair = example("hololens_00011_00015.json");
    let told = run(&["estimate", &pair, &pair, "--progress", "always"]).stderr;
    assert!(told.starts_with("progress: 2 pairs in ") && told.ends_with(" s\n"), "{told}");
    let table = ["simulate", "--figure", "4", "--trials", "2", "--solvers", "quest", "--format", "csv"];
    let told = run(&[&table[..], &["--progress", "always"]].concat()).stderr;
    let counts = told.strip_prefix("progress: ").unwrap().split(" scenes in ").next().unwrap().to_owned();
    let (done, total) = counts.split_once(" of ").unwrap();
    assert!(done == total && done.parse::<u64>().unwrap() > 2, "{told}");
    for more in [&[][..], &["--progress", "never"], &["--progress", "auto"], &["--quiet"]] {
        assert_eq!(run(&[&["estimate", &pair], more].concat()).stderr, "", "{more:?}");
    }
    let both = run(&["estimate", &pair, "--progress", "always", "--quiet"]);
    assert!(both.status == 2 && both.stderr.contains("cannot be used with"), "{}", both.stderr);
}

#[test]
fn what_would_have_no_effect_is_an_error() {
    let (points, pair) = (example("points.json"), example("tumfr3_98072_98172.json"));
    for (arguments, words) in [
        (&["estimate", &pair, "--min-iterations", "20", "--max-iterations", "10"][..], "--max-iterations 10"),
        (&["solve", &points, "-o", "out.npz"], "results are not written as NumPy's arrays"),
        (&["solve", &points, "--rotation", "1,0,0,0", "--solver", "nister"], "cannot be used with"),
        (&["estimate", &pair, "-o", "out.json", "--resume"], "found --resume"),
        (&["estimate", &pair, &pair, "--initial-pose", "1,0,0,0,0,0,1"], "several pairs and --initial-pose"),
    ] {
        let run = run(arguments);
        assert!(run.status == 2 && run.stderr.contains(words), "{arguments:?}: {}", run.stderr);
    }
}

#[test]
fn an_existing_file_survives_a_failure() {
    let directory = directory_with("out.json", "kept");
    let run = run_in(directory.path(), &["solve", "-", "-o", "out.json"], b"{\"matches\": [[1");
    assert_eq!(run.status, 2, "{}", run.stderr);
    assert_eq!(fs::read_to_string(directory.path().join("out.json")).unwrap(), "kept");
    assert_eq!(files(directory.path()), ["out.json"]);
}

#[test]
fn a_path_that_cannot_be_written() {
    let directory = directory_with("file", "kept");
    for (path, why) in [("no/out.json", "No such file or directory"), (".", "is a directory"), ("file/x", "")]
    {
        let run = run_in(directory.path(), &["solvers", "--no-times", "-o", path], b"");
        assert!(
            run.stderr.starts_with(&format!("error: {path}: cannot be written: {why}")),
            "{}",
            run.stderr
        );
        assert_eq!((run.status, run.stderr.lines().count()), (2, 1));
    }
    assert_eq!(files(directory.path()), ["file"]);
}

#[cfg(unix)]
mod unix {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).unwrap().permissions().mode() & 0o777
    }

    #[test]
    fn a_file_that_is_read_only_is_not_replaced() {
        let directory = directory_with("out.json", "kept");
        let path = directory.path().join("out.json");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o444)).unwrap();
        let run = run_in(directory.path(), &["solvers", "--no-times", "-o", "out.json"], b"");
        assert_eq!(run.stderr, "error: out.json: cannot be written: permission denied\n");
        assert_eq!((run.status, fs::read_to_string(path).unwrap().as_str()), (2, "kept"));
    }

    #[test]
    fn the_permissions_and_links_of_a_file_stay() {
        let directory = directory_with("real.json", "old");
        let (real, link) = (directory.path().join("real.json"), directory.path().join("link.json"));
        fs::set_permissions(&real, fs::Permissions::from_mode(0o640)).unwrap();
        symlink("real.json", &link).unwrap();
        assert_eq!(run_in(directory.path(), &["solvers", "--no-times", "-o", "link.json"], b"").status, 0);
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert!(fs::read_to_string(&real).unwrap().starts_with("[{"));
        assert_eq!(mode(&real), 0o640);
    }

    #[test]
    fn a_link_that_leads_to_no_file_yet_stays_a_link() {
        let directory = tempfile::tempdir().unwrap();
        let (real, link) = (directory.path().join("real.json"), directory.path().join("link.json"));
        symlink("real.json", &link).unwrap();
        assert_eq!(run_in(directory.path(), &["solvers", "--no-times", "-o", "link.json"], b"").status, 0);
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert!(fs::read_to_string(&real).unwrap().starts_with("[{"));
        symlink("round.json", directory.path().join("round.json")).unwrap();
        let run = run_in(directory.path(), &["solvers", "--no-times", "-o", "round.json"], b"");
        assert!(run.status == 2 && run.stderr.contains("leads back to itself"), "{}", run.stderr);
    }

    #[test]
    fn a_new_file_is_not_private() {
        let directory = tempfile::tempdir().unwrap();
        assert_eq!(run_in(directory.path(), &["solvers", "--no-times", "-o", "new.json"], b"").status, 0);
        fs::write(directory.path().join("plain"), "").unwrap();
        assert_eq!(mode(&directory.path().join("new.json")), mode(&directory.path().join("plain")));
    }

    #[test]
    fn standard_output_has_a_name() {
        let shown = run(&["solvers", "--no-times"]).stdout;
        assert_eq!(run(&["solvers", "--no-times", "-o", "/dev/stdout"]).stdout, shown);
        assert_eq!(run(&["solvers", "--no-times", "-o", "-"]).stdout, shown);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk() {
    let run = run(&["solvers", "--no-times", "-o", "/dev/full"]);
    assert_eq!(run.stderr, "error: /dev/full: cannot be written: No space left on device\n");
    assert_eq!(run.status, 2);

    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let child = Command::new(env!("CARGO_BIN_EXE_quest-cli"))
        .args(["solvers", "--no-times"])
        .stdout(full)
        .output()
        .unwrap();
    let stderr = String::from_utf8(child.stderr).unwrap();
    assert_eq!(stderr, "error: standard output: cannot be written: No space left on device\n");
    assert_eq!(child.status.code(), Some(2));
}

#[test]
fn a_reader_that_leaves_is_no_error() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_quest-cli"))
        .args(["solve", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let pair = format!("{{\"matches\": {}}}\n", five_matches());
    child.stdin.take().unwrap().write_all(pair.repeat(2).as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]));
}

#[test]
fn a_reader_that_leaves_a_long_table_is_no_error() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_quest-cli"))
        .args(["simulate", "--figure", "4", "--trials", "1", "--solvers", "quest", "--format", "csv"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]));
}

#[test]
fn a_name_without_a_known_extension_gets_what_the_help_says() {
    let help = run(&["estimate", "--help"]).stdout.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(help.contains("else a table; of several pairs JSON Lines"), "{help}");
    let pair = example("tumfr3_98072_98172.json");
    let folder = tempfile::tempdir().unwrap();
    let written = |files: &[&str]| {
        let run = run_in(folder.path(), &[&["estimate", "-o", "e.txt", "--quiet"], files].concat(), b"");
        assert_eq!(run.status, 0, "{}", run.stderr);
        fs::read_to_string(folder.path().join("e.txt")).unwrap()
    };
    assert!(written(&[&pair]).starts_with("tumfr3_98072_98172: 500 matches"));
    assert!(written(&[&pair, &pair]).starts_with("{\"name\":"));
}

#[test]
fn solvers_say_nothing_where_they_measure_nothing() {
    for more in [&["--no-times"][..], &["--quiet"]] {
        assert_eq!(run(&[&["solvers"], more].concat()).stderr, "", "{more:?}");
    }
}
