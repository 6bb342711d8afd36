//! How the command ends when it is told to.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// As in `monro serve CASE 2>&1 | head -3`: the thread that waits for signals failed to print its farewell.
#[test]
fn a_program_whose_error_output_is_closed_can_still_be_ended() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_monro"))
        .args(["fake-tracker", "openigtlink", "--listen", "127.0.0.1:0"])
        .stderr(Stdio::piped())
        .spawn()
        .expect("monro");
    let mut first = String::new();
    BufReader::new(child.stderr.take().expect("piped")).read_line(&mut first).expect("a line");
    assert!(first.contains("listens on"), "{first}");
    let kill = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().expect("kill");
    assert!(kill.success());
    let end = Instant::now() + Duration::from_secs(30);
    while child.try_wait().expect("status").is_none() && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(20));
    }
    // Of one that has ended this does nothing; of one that has not, there is no code.
    let _ = child.kill();
    assert_eq!(child.wait().expect("status").code(), Some(0), "it is ended so");
}
