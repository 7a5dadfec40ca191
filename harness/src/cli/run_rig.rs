//! `drivebench run --rig NAME` on a rig with ports: taken, guarded, and given back in its safe state.

use super::args::RunArguments;
use super::exit::Exit;
use super::output::Output;
use super::rig_failure::{exit_of, interrupt_flag, tell_end};
use super::run::{details, line, progress_bar, summary};
use crate::library::Entry;
use crate::link::{Line, Trouble};
use crate::report::plot::plot;
use crate::rig::{Options, Played, Rig, Run, Session};
use crate::scenario::run::Outcome;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;

/// Plays scenarios on a rig.
pub(super) fn run(
    rig: &Rig,
    entries: &[Entry],
    arguments: &RunArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let options = Options {
        purpose: "run".to_owned(),
        wait: arguments.wait.unwrap_or_default(),
        allow_motion: arguments.allow_motion,
        interrupt: interrupt_flag(),
    };
    let mut session = match Session::open(rig, &options) {
        Ok(session) => session,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(exit_of(&error));
        }
    };
    let bar = progress_bar(entries.len(), output.progress);
    let mut verdicts = Vec::new();
    let mut took = Span::ZERO;
    let mut stopped = None;
    {
        let mut run = match Run::new(&mut session) {
            Ok(run) => run,
            Err(problems) => {
                output.mistakes(&problems);
                return Ok(Exit::Usage);
            }
        };
        for entry in entries {
            bar.set_message(entry.short_name().to_owned());
            let played = match &entry.plan {
                None => skipped("the rig has no such bus"),
                Some(plan) => match run.play(plan) {
                    Ok(played) => played,
                    Err(error) => {
                        stopped = Some(error);
                        break;
                    }
                },
            };
            let outcome = &played.outcome;
            took = took + outcome.took;
            verdicts.push(outcome.verdict);
            let mut text = line(entry, outcome, output);
            if arguments.records || entries.len() == 1 {
                text.extend(outcome.records.iter().map(plot));
            }
            bar.suspend(|| output.result(&text))?;
            let traces = played.attempts.last().map_or(&[][..], |last| &last.traces);
            let told = details(entry, outcome, traces);
            bar.suspend(|| output.say(&told));
            bar.inc(1);
            let session = run.session();
            if session.overdue() {
                output.complain("the rig's file allows no longer run (max_run)");
                break;
            }
            if matches!(
                session.link().trouble(),
                Some(Trouble::Lost(_) | Trouble::Garbled(_) | Trouble::Interrupted)
            ) {
                break;
            }
        }
    }
    bar.finish_and_clear();
    output.result(&summary(&verdicts, took))?;
    let interrupted = session.link().trouble() == Some(&Trouble::Interrupted);
    let played = if interrupted {
        Exit::Interrupted
    } else {
        match &stopped {
            Some(error) => {
                output.complain(&error.to_string());
                exit_of(error)
            }
            None => Exit::of(&verdicts, arguments.require_all),
        }
    };
    let end = match played {
        Exit::RigError => session.close_with_error(),
        _ => session.close(),
    };
    Ok(tell_end(&end, played, output))
}

fn skipped(why: &str) -> Played {
    Played {
        outcome: Outcome {
            verdict: Verdict::Skipped,
            ..Outcome::skipped(why.to_owned())
        },
        attempts: Vec::new(),
    }
}
