//! `QUEST_INSTRUCTIONS` gives the answers of another processor.

use super::*;

fn estimated(instructions: &str) -> Run {
    let output = Command::new(env!("CARGO_BIN_EXE_quest-cli"))
        .args(["estimate", &example("tumfr3_98072_98172.json"), "--format", "json"])
        .env("QUEST_INSTRUCTIONS", instructions)
        .output()
        .unwrap();
    Run {
        status: output.status.code().unwrap(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

fn available() -> impl Iterator<Item = quest_core::lanes::Instructions> {
    quest_core::lanes::Instructions::ALL.into_iter().filter(|i| i.is_available())
}

#[test]
fn all_instructions_lead_to_the_same_matches() {
    let answer = |name: &str| -> serde_json::Value { serde_json::from_str(&estimated(name).stdout).unwrap() };
    let portable = answer("portable");
    for instructions in available() {
        let found = answer(instructions.name());
        for key in ["model", "inliers", "iterations"] {
            assert!(!portable[key].is_null(), "{key}");
            assert_eq!(found[key], portable[key], "{}: {key}", instructions.name());
        }
    }
}

#[test]
fn a_name_that_is_none_is_refused() {
    let names: Vec<_> = available().map(quest_core::lanes::Instructions::name).collect();
    let run = estimated("sse9");
    let expected = format!("error: QUEST_INSTRUCTIONS is \"sse9\", expected one of {}\n", names.join(", "));
    assert_eq!((run.status, run.stderr), (2, expected));
}
