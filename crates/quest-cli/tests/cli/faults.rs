//! Faults of the machine: a run that is killed, a disk that is full, threads and memory that are refused. The file of `-o` is the old
//! one or the new one, and nothing else is left. `scripts/faults N` tries each of them N times.

use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Output};
use std::thread;
use std::time::{Duration, Instant};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::*;

const SEED: u64 = 0xfa_0175;

/// How often each fault is tried.
fn tries() -> u64 {
    std::env::var("QUEST_FAULTS").map_or(3, |count| count.parse().expect("QUEST_FAULTS is a number"))
}

/// A folder with the file of so many pairs, which anybody may write to.
fn folder(pairs: usize) -> TempDir {
    use std::os::unix::fs::PermissionsExt;
    let names = ["tumfr3_98072_98172.json", "hololens_00011_00015.json", "tiny_berlin_7in.json"];
    let lines = names.map(|name| {
        let text = fs::read_to_string(example(name)).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap().to_string() + "\n"
    });
    let text: String = lines.iter().cycle().take(pairs).map(String::as_str).collect();
    let folder = directory_with("pairs.jsonl", text);
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o777)).unwrap();
    folder
}

const BATCH: [&str; 5] = ["estimate", "pairs.jsonl", "-o", "out.jsonl", "--quiet"];

/// A program of the system that begins ours, such as `prlimit`, in this folder, and not as the system's administrator, whom some
/// limits do not bind.
fn by(folder: &Path, program: &[&str], arguments: &[&str]) -> Command {
    let all: Vec<&str> = program
        .iter()
        .copied()
        .chain([env!("CARGO_BIN_EXE_quest-cli")])
        .chain(arguments.iter().copied())
        .collect();
    let mut command = Command::new(all[0]);
    command.args(&all[1..]).current_dir(folder).stdin(Stdio::null());
    if is_root() {
        const NOBODY: u32 = 65_534;
        command.uid(NOBODY).gid(NOBODY);
    }
    command
}

fn is_root() -> bool {
    fs::read_to_string("/proc/self/status").unwrap().lines().any(|line| line.starts_with("Uid:\t0\t"))
}

fn text(folder: &Path, name: &str) -> Option<String> {
    fs::read_to_string(folder.join(name)).ok()
}

/// Records without the time that each took, which is another one in every run.
fn timeless(text: &str) -> String {
    let mut parts = text.split("\"elapsed_ms\":");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |all, part| {
        all + part.trim_start_matches(|c: char| c.is_ascii_digit() || ".e-".contains(c))
    })
}

/// The names of the files of the folder but for the input.
fn left(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = names.filter(|name| name != "pairs.jsonl").collect();
    names.sort();
    names
}

/// What the batch writes where nothing goes wrong, and how long it takes.
fn whole(folder: &Path) -> (String, Duration) {
    let begin = Instant::now();
    assert!(by(folder, &[], &BATCH).status().unwrap().code().is_some());
    let took = begin.elapsed();
    let text = timeless(&text(folder, "out.jsonl").unwrap());
    fs::remove_file(folder.join("out.jsonl")).unwrap();
    (text, took)
}

/// Begins a batch and sends it the signal at a moment of its time.
fn interrupted(folder: &Path, signal: &str, moment: Duration) -> Output {
    let child: Child = by(folder, &[], &BATCH).stderr(Stdio::piped()).spawn().unwrap();
    thread::sleep(moment);
    let id = child.id().to_string();
    // The run may have ended already.
    assert!(
        Command::new("sh")
            .args(["-c", "kill -$0 $1 2> /dev/null || true", signal, &id])
            .status()
            .unwrap()
            .success()
    );
    child.wait_with_output().unwrap()
}

#[test]
fn a_batch_that_is_ended_leaves_the_old_file_or_the_new_one() {
    let folder = folder(36);
    let folder = folder.path();
    let (whole, took) = whole(folder);
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut ended = 0;
    for index in 0..3 * tries() {
        let signal = ["KILL", "INT", "TERM"][usize::try_from(index % 3).unwrap()];
        fs::write(folder.join("out.jsonl"), "{\"old\":1}\n").unwrap();
        let moment = took.mul_f64(f64::from(rng.next_u32()) / f64::from(u32::MAX));
        ended += u64::from(interrupted(folder, signal, moment).status.signal().is_some());
        let found = text(folder, "out.jsonl").unwrap();
        let is_new = timeless(&found) == whole;
        assert!(is_new || found == "{\"old\":1}\n", "{signal} after {moment:?}: {} bytes", found.len());
        let names = left(folder);
        // Only what cannot clean up leaves a file that has not got its name yet.
        let are_ours = |name: &String| {
            ["out.jsonl", "out.jsonl.part"].contains(&name.as_str()) || name.starts_with(".quest-")
        };
        assert!(names.iter().all(are_ours), "{names:?}");
        for name in names {
            fs::remove_file(folder.join(name)).unwrap();
        }
    }
    // A test in which all runs were over in time would have seen nothing.
    assert!(ended > tries(), "{ended}");
}

#[test]
fn a_batch_that_goes_on_has_the_bytes_of_one_that_was_not_ended() {
    let folder = folder(36);
    let folder = folder.path();
    let (whole, took) = whole(folder);
    let mut rng = ChaCha8Rng::seed_from_u64(SEED + 1);
    let mut kept = 0;
    for index in 0..tries() {
        let signal = ["KILL", "INT", "TERM"][usize::try_from(index % 3).unwrap()];
        let moment = took.mul_f64(0.3 + 0.6 * f64::from(rng.next_u32()) / f64::from(u32::MAX));
        interrupted(folder, signal, moment);
        kept += text(folder, "out.jsonl.part").map_or(0, |part| part.lines().count());
        let resumed = by(folder, &[], &BATCH).arg("--resume").status().unwrap();
        assert!(resumed.code().is_some());
        let is_same = timeless(&text(folder, "out.jsonl").unwrap()) == whole;
        assert!(is_same, "{signal} after {moment:?}");
        for name in left(folder) {
            fs::remove_file(folder.join(name)).unwrap();
        }
    }
    assert!(kept > 0, "no run was ended after it had written a record");
}

#[test]
fn a_file_that_may_grow_no_further() {
    let folder = folder(12);
    let folder = folder.path();
    for _ in 0..tries() {
        for arguments in [&BATCH[..], &["estimate", "pairs.jsonl", "-o", "out.json", "--quiet"]] {
            fs::write(folder.join(arguments[3]), "old").unwrap();
            let run = by(folder, &["prlimit", "--fsize=600"], arguments).output().unwrap();
            let said = String::from_utf8(run.stderr).unwrap();
            assert!(said.contains("cannot be written: File too large"), "{said}");
            assert_eq!(run.status.code(), Some(2));
            assert_eq!(text(folder, arguments[3]).unwrap(), "old");
            // The records that were written stay, to go on after them.
            let mut expected = vec![arguments[3]];
            if arguments[3] == "out.jsonl" {
                expected.push("out.jsonl.part");
            }
            assert_eq!(left(folder), expected);
            for name in left(folder) {
                fs::remove_file(folder.join(name)).unwrap();
            }
        }
    }
}

/// In a namespace of mounts of its own, which the system may not allow.
#[test]
#[ignore = "needs the right to mount a file system; scripts/faults runs it"]
fn a_disk_that_is_full() {
    let folder = folder(36);
    let folder = folder.path();
    let (whole, _) = whole(folder);
    let script = "mount -t tmpfs -o size=8k,mode=777 none disk && printf old > disk/out.jsonl && \
                  { $0 estimate pairs.jsonl -o disk/out.jsonl --quiet; echo $?; cat disk/out.jsonl; ls -A disk; \
                    $0 solve pairs.jsonl -o disk/all.json --quiet; echo $?; ls -A disk; }";
    fs::create_dir(folder.join("disk")).unwrap();
    assert!(whole.len() > 8_192);
    for _ in 0..tries() {
        let run = Command::new("unshare")
            .args(["-rm", "sh", "-c", script, env!("CARGO_BIN_EXE_quest-cli")])
            .current_dir(folder)
            .output()
            .unwrap();
        let said = String::from_utf8(run.stderr).unwrap();
        assert!(said.contains("disk/out.jsonl: cannot be written: No space left on device"), "{said}");
        let shown = String::from_utf8(run.stdout).unwrap();
        assert_eq!(shown, "2\noldout.jsonl\nout.jsonl.part\n2\nout.jsonl\nout.jsonl.part\n");
    }
}

#[test]
fn a_folder_that_cannot_be_written() {
    use std::os::unix::fs::PermissionsExt;
    let folder = folder(3);
    let folder = folder.path();
    let set = |mode| fs::set_permissions(folder, fs::Permissions::from_mode(mode)).unwrap();
    fs::write(folder.join("out.jsonl"), "old").unwrap();
    fs::set_permissions(folder.join("out.jsonl"), fs::Permissions::from_mode(0o666)).unwrap();
    for _ in 0..tries() {
        set(0o555);
        let run = by(folder, &[], &BATCH).output().unwrap();
        set(0o777);
        let said = String::from_utf8(run.stderr).unwrap();
        assert!(
            said.starts_with("error: out.jsonl: cannot be written: ") && said.lines().count() == 1,
            "{said}"
        );
        assert_eq!((run.status.code(), text(folder, "out.jsonl").unwrap().as_str()), (Some(2), "old"));
        assert_eq!(left(folder), ["out.jsonl"]);
    }
}

#[test]
fn threads_that_are_refused() {
    let folder = folder(12);
    let folder = folder.path();
    let estimates = ["estimate", "pairs.jsonl", "--threads", "4", "--quiet"];
    let expected = by(folder, &[], &estimates).output().unwrap();
    let figure =
        ["simulate", "--figure", "4", "--trials", "2", "--solvers", "quest", "--format", "csv", "--quiet"];
    for _ in 0..tries() {
        let run = by(folder, &["prlimit", "--nproc=1"], &estimates).output().unwrap();
        assert_eq!(run.status.code(), expected.status.code());
        let shown = [&run, &expected].map(|run| timeless(str::from_utf8(&run.stdout).unwrap()));
        assert!(shown[0] == shown[1] && !shown[0].is_empty(), "{} bytes", shown[0].len());
        let run = by(folder, &["prlimit", "--nproc=1"], &figure).output().unwrap();
        let said = str::from_utf8(&run.stderr).unwrap();
        assert!(said.starts_with("error: --threads: ") && said.lines().count() == 1, "{said}");
        assert_eq!((run.status.code(), run.stdout.len()), (Some(2), 0));
    }
}

#[test]
fn the_limit_on_threads_binds() {
    // The test above would pass where it did not.
    let folder = folder(0);
    let script = "sleep 0 & wait $!";
    let mut shell = Command::new("prlimit");
    shell.args(["--nproc=1", "sh", "-c", script]).current_dir(folder.path());
    if is_root() {
        shell.uid(65_534).gid(65_534);
    }
    assert!(!shell.output().unwrap().status.success());
}

#[test]
fn memory_that_is_refused() {
    let folder = folder(0);
    let folder = folder.path();
    fs::write(folder.join("out.json"), "old").unwrap();
    let endless =
        ["solve", "/dev/zero", "--input-format", "json", "--max-input", "99999999999", "-o", "out.json"];
    for _ in 0..tries() {
        let run = by(folder, &["prlimit", "--as=300000000"], &endless).output().unwrap();
        let said = String::from_utf8(run.stderr).unwrap();
        assert_eq!(said, "error: /dev/zero: cannot be read: out of memory\n");
        assert_eq!((run.status.code(), text(folder, "out.json").unwrap().as_str()), (Some(2), "old"));
    }
}

#[test]
fn input_that_never_ends() {
    let folder = folder(0);
    let folder = folder.path();
    for format in ["json", "jsonl", "csv"] {
        let endless = ["estimate", "/dev/zero", "--input-format", format, "--max-input", "1000000"];
        let run = by(folder, &[], &endless).output().unwrap();
        let line = if format == "jsonl" { "line 1: " } else { "" };
        let expected = format!(
            "error: /dev/zero: {line}found a pair of more than 1000000 bytes, expected at most as many; --max-input allows more\n"
        );
        assert_eq!((run.status.code(), String::from_utf8(run.stderr).unwrap()), (Some(2), expected));
    }
    // Where the form is not known its beginning is read first.
    let run = by(folder, &[], &["solve", "/dev/zero", "--max-input", "1000000"]).output().unwrap();
    assert!(String::from_utf8(run.stderr).unwrap().contains("found a pair of more than 1000000 bytes"));
}

#[test]
fn a_pair_of_just_the_limit_is_read() {
    let text = format!("{{\"matches\": {}}}", five_matches());
    let folder = directory_with("a.json", &text);
    let solve =
        |most: usize| run_in(folder.path(), &["solve", "a.json", "--max-input", &most.to_string()], b"");
    assert_eq!(solve(text.len()).status, 0);
    assert_eq!(solve(text.len() - 1).status, 2);
}
