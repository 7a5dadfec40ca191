//! The part of the check that simulated drives are made of: the profile that a rig names, and the lines of `[sim]`.

use super::check::{Check, FindProfile};
use super::file::Sim;
use super::profile::{KnownProfile, Profile};
use crate::file::schema::Step;
use crate::rig::sim::{lines, settle};
use crate::scenario::problem::Problem;
use crate::scenario::source::Source;

impl Check<'_> {
    /// The profile that the rig's file names.
    pub(crate) fn profile(&mut self, find: &FindProfile<'_>) -> Option<KnownProfile> {
        let named = self.file.rig.profile.as_ref()?;
        let profile = find(named).and_then(|source| {
            let profile = Profile::parse(&source.text);
            let profile = profile.map_err(|error| format!("{}: {error}", source.name))?;
            Ok(KnownProfile {
                lines: profile.lines().map(str::to_owned).collect(),
                text: source.text.to_string(),
            })
        });
        match profile {
            Ok(profile) => Some(profile),
            Err(message) => {
                let expected = "the path of a profile that `drivebench qualify` has written, from the folder of this file, expected here";
                self.wrong(&["rig".into(), "profile".into()], message, expected);
                None
            }
        }
    }

    /// The lines of `[sim]` make drives, together with what stands in front of them.
    pub(crate) fn setup(&mut self, source: &Source, profile: Option<&KnownProfile>) {
        let none = Sim::default();
        let sim = self.file.sim.as_ref().unwrap_or(&none);
        let (lines, before) = lines(self.file, profile, &[]);
        let at = |index: usize| [Step::Key("sim"), Step::Key("setup"), Step::Index(index)];
        if let Some(index) = sim
            .setup
            .iter()
            .position(|line| line.contains(['\n', '\r']))
        {
            self.wrong(
                &at(index),
                "this is more than one line",
                "one line expected here",
            );
        } else if let Err(problems) = settle(&source.name, self.file, &lines) {
            let text = lines.join("\n");
            for problem in problems.all() {
                let text = text.get(..problem.span.start).unwrap_or(&text);
                let line = text.matches('\n').count();
                let span = match line.checked_sub(before) {
                    Some(index) => self.place(&at(index)),
                    None => self.place(&["rig".into(), "profile".into()]),
                };
                self.problems.push(Problem {
                    span,
                    ..problem.clone()
                });
            }
        }
    }
}
