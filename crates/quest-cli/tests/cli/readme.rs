//! The examples of the root's README.md print what stands there.

use super::*;

/// Times differ from run to run, and with them the widths of their column and of the table.
fn untimed(text: &str) -> String {
    let Some(table) = text.strip_prefix("solver ") else { return text.to_owned() };
    let word = |word: &str| match word {
        _ if word.contains('.') && word.parse::<f64>().is_ok() => "TIME".to_owned(),
        _ if word.starts_with('─') => "─".to_owned(),
        _ => word.to_owned(),
    };
    let line = |line: &str| line.split_whitespace().map(word).collect::<Vec<_>>().join(" ");
    table.lines().map(line).collect::<Vec<_>>().join("\n")
}

#[test]
fn console_examples_are_true() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let readme = fs::read_to_string(root.join("README.md")).unwrap();
    let mut examples = 0;
    for block in readme.split("```console\n").skip(1) {
        let block = block.split("```").next().unwrap();
        let (command, expected) = block.split_once('\n').unwrap();
        let command = command.replace("cargo run --release -p quest-cli --", "quest-cli");
        let arguments: Vec<_> = command.strip_prefix("$ quest-cli ").unwrap().split(' ').collect();
        let run = run_in(&root, &arguments, b"");
        assert_eq!((run.status, run.stderr.as_str()), (0, ""), "{command}");
        // The first command is shown for what it does, its output further down.
        if !expected.is_empty() {
            assert_eq!(untimed(&run.stdout), untimed(expected), "{command}");
            examples += 1;
        }
    }
    assert_eq!(examples, 5);
}
