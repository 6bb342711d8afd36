//! The `monro` command: from a head CT to a simulated catheter. Research software, not for clinical use.

mod args;
mod bench;
mod calibrate;
mod columns;
mod console;
mod demo;
mod edit;
mod inspect;
mod interrupt;
mod labels;
mod materials;
mod mesh;
mod mesh_file;
mod output_file;
mod phantom;
mod prepare;
mod recorded;
mod register;
mod replay;
mod serve;
mod simulate;
mod soft_body;
mod solve;
mod trackers;

use args::Command;
use console::Console;
use monro_prepare::NOTICE;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = args::parse(std::env::args_os());
    interrupt::install();
    let console = Console::new(cli.json);
    let result = match &cli.command {
        Command::Demo(a) => demo::run(a, &console),
        Command::Inspect(a) => inspect::run(a, &console),
        Command::Phantom(a) => phantom::run(a, &console),
        Command::Prepare(a) => prepare::run(a, &console),
        Command::Simulate(a) => simulate::run(a, &console),
        Command::Edit(a) => edit::run(a, &console),
        Command::Solve(a) => solve::run(a, &console),
        Command::Serve(a) => serve::run(a, &console),
        Command::Replay(a) => replay::run(a, &console),
        Command::Labels(a) => labels::run(a, &console),
        Command::Mesh(a) => mesh::run(a, &console),
        Command::Track(a) => trackers::track(a, cli.json),
        Command::FakeTracker(a) => trackers::fake(a),
        Command::Doctor(a) => trackers::doctor(a, &console),
        Command::Calibrate(a) => calibrate::run(a, &console),
        Command::Register(a) => register::run(a, &console),
        Command::Bench(a) => bench::run(a, &console),
    };
    console.finish();
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            console::tell(&format!("monro: {}", one_line(&error)));
            ExitCode::FAILURE
        }
    }
}

/// An error with its causes; a cause that the message before it quotes already is not said again.
fn one_line(error: &anyhow::Error) -> String {
    let mut out = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !out.contains(&cause) {
            out = format!("{out}: {cause}");
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::one_line;
    use anyhow::Context;

    #[test]
    fn a_plan_that_is_not_json_was_told_twice() {
        let broken = monro_case::markups::decode("{junk").map(|_| ()).context("plan.mrk.json").expect_err("no JSON");
        let told = one_line(&broken);
        assert_eq!(told.matches("line 1").count(), 1, "{told}");
        assert!(told.starts_with("plan.mrk.json: the file is not JSON"), "{told}");
    }
}
