//! `completions` and `man`.

use super::*;

#[test]
fn every_shell_completes_every_command() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let run = run(&["completions", shell]);
        assert_eq!((run.status, run.stderr.as_str()), (0, ""), "{shell}");
        for word in ["estimate", "servo", "polynomials", "replay", "max-iterations"] {
            assert!(run.stdout.contains(word), "{shell}: {word}");
        }
    }
    let run = run(&["completions", "tcsh"]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("bash"), "{}", run.stderr);
}

/// Bash completes options by the script.
#[test]
#[cfg(unix)]
fn bash_completes_options() {
    let directory = directory_with("quest-cli.bash", run(&["completions", "bash"]).stdout);
    for (words, last, before, expected) in
        [("servo --rep", "--rep", "servo", "--replay"), ("colmap ver", "ver", "colmap", "verify")]
    {
        let asked = format!(
            "source quest-cli.bash; COMP_WORDS=(quest-cli {words}); COMP_CWORD=2; _quest__cli quest-cli {last} {before}; \
             echo ${{COMPREPLY[@]}}"
        );
        let done = Command::new("bash").args(["-c", &asked]).current_dir(directory.path()).output().unwrap();
        assert_eq!(String::from_utf8_lossy(&done.stdout).trim(), expected, "{done:?}");
    }
}

#[test]
fn a_page_for_each_command() {
    let directory = tempfile::tempdir().unwrap();
    let folder = directory.path().to_str().unwrap();
    let made = run(&["man", folder]);
    assert_eq!((made.status, made.stdout.as_str(), made.stderr.as_str()), (0, "", ""));
    for name in ["quest-cli.1", "quest-cli-estimate.1", "quest-cli-servo.1", "quest-cli-colmap-verify.1"] {
        let page = fs::read_to_string(directory.path().join(name)).unwrap();
        assert!(page.contains(".SH NAME") && page.contains(".SH SYNOPSIS"), "{name}");
    }
    let page = fs::read_to_string(directory.path().join("quest-cli-servo.1")).unwrap();
    assert!(page.contains("replay") && page.contains("Exit status"));
    let nowhere = run(&["man", "nowhere/at/all"]);
    assert_eq!((nowhere.status, nowhere.stdout.as_str()), (2, ""));
}
