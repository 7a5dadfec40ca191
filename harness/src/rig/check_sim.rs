//! The part of the check that simulated drives are made of: the profile that a rig names, and the lines of `[sim]`.

use super::check::{FindProfile, RigCheck};
use super::file::Sim;
use super::profile::{KnownProfile, Profile};
use crate::buses::header::{for_other_rings, parse_lines};
use crate::buses::syntax::Header;
use crate::file::schema::Step;
use crate::rig::sim::{mistakes, sizes};
use crate::scenario::problem::{Problem, Span};
use crate::scenario::source::{Source, line_number};

impl RigCheck<'_> {
    /// The profile that the rig's file names.
    pub(crate) fn profile(&mut self, find: &FindProfile<'_>) -> Option<KnownProfile> {
        let named = self.file.rig.profile.as_ref()?;
        let profile = find(named).and_then(|source| {
            let profile = Profile::parse(&source.text);
            let profile = profile.map_err(|error| format!("{}: {error}", source.name))?;
            Ok(KnownProfile {
                header: profile.header(),
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

    /// Reads the lines of `[sim]`, and settles them behind the profile for the rig's rings.
    pub(crate) fn setup(&mut self, source: &Source, profile: Option<&KnownProfile>) -> Header {
        let none = Sim::default();
        let lines = &self.file.sim.as_ref().unwrap_or(&none).setup;
        let line = |index: usize| [Step::Key("sim"), Step::Key("setup"), Step::Index(index)];
        let long = |line: &String| line.contains(['\n', '\r']);
        if let Some(index) = lines.iter().position(long) {
            self.wrong(
                &line(index),
                "this is more than one line",
                "one line expected here",
            );
            return Header::default();
        }
        let text = lines.join("\n");
        let place = |span: Span| line(line_number(&text, span.start) - 1);
        let read = parse_lines(&Source {
            name: source.name.clone(),
            text: text.as_str().into(),
        });
        let own = match read {
            Ok(own) => own,
            Err(problems) => {
                for problem in problems.all() {
                    self.add(&place(problem.span), problem);
                }
                return Header::default();
            }
        };
        if let Some(problem) = for_other_rings(&own, &sizes(self.file)) {
            self.add(&place(problem.span), &problem);
            return own;
        }
        for (setup, problem) in mistakes(&source.name, self.file, profile, &own) {
            match setup {
                Some(setup) => self.add(&place(setup.span), &problem),
                None => self.add(&["rig".into(), "profile".into()], &problem),
            }
        }
        own
    }

    /// Adds a mistake at a value of the rig's file.
    pub(crate) fn add(&mut self, path: &[Step<'_>], problem: &Problem) {
        let span = self.place(path);
        self.problems.push(Problem {
            span,
            ..problem.clone()
        });
    }
}
