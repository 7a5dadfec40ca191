//! The part of the check that simulated drives are made of: the profile that a rig names, and the lines of `[sim]`.

use super::check::{FindProfile, RigCheck};
use super::file::Sim;
use super::port_file::Port;
use super::profile::{KnownProfile, Profile, ProfileError, ProfileLines};
use crate::file::schema::PathStep;
use crate::scenario::problem::{Problem, TextSpan};
use crate::scenario::source::{Source, line_number};

impl RigCheck<'_> {
    /// The profile that the rig's file names, of drives in rings.
    pub fn profile(&mut self, find: &FindProfile<'_>) -> Option<KnownProfile> {
        let (lines, text) = self.read_profile(find, self.buses.rings.profile)?;
        Some(KnownProfile { text, lines })
    }

    /// The same, of drives behind a port. Each of its lines must be about one of them.
    pub(crate) fn port_profile(
        &mut self,
        port: &Port,
        find: &FindProfile<'_>,
    ) -> Option<KnownProfile> {
        let read = |text: &str| Ok(Profile::<ProfileLines>::parse(text)?.header());
        let (lines, text) = self.read_profile(find, read)?;
        let row = self.buses.port(port.bus);
        for (_, problem) in row.line_mistakes(port, &lines) {
            self.wrong(
                &["rig".into(), "profile".into()],
                format!("the profile is not of these drives: {}", problem.message),
                "the profile that `drivebench qualify` writes for the drives of this file expected here",
            );
        }
        Some(KnownProfile { text, lines })
    }

    fn read_profile(
        &mut self,
        find: &FindProfile<'_>,
        read: impl Fn(&str) -> Result<ProfileLines, ProfileError>,
    ) -> Option<(ProfileLines, String)> {
        let named = self.file.rig.profile.as_ref()?;
        let profile = find(named).and_then(|source| {
            let lines = read(&source.text);
            let lines = lines.map_err(|error| format!("{}: {error}", source.name))?;
            Ok((lines, source.text.to_string()))
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
    pub fn setup(&mut self, source: &Source, profile: Option<&KnownProfile>) {
        let none = Sim::default();
        let lines = &self.file.sim.as_ref().unwrap_or(&none).setup;
        let line = |index: usize| {
            [
                PathStep::Key("sim"),
                PathStep::Key("setup"),
                PathStep::Index(index),
            ]
        };
        let long = |line: &String| line.contains(['\n', '\r']);
        if let Some(index) = lines.iter().position(long) {
            self.wrong(
                &line(index),
                "this is more than one line",
                "one line expected here",
            );
            return;
        }
        let text = lines.join("\n");
        let place = |span: TextSpan| line(line_number(&text, span.start) - 1);
        let lines = Source {
            name: source.name.clone(),
            text: text.as_str().into(),
        };
        let profile = profile.map(|profile| profile.lines.as_slice());
        for (span, problem) in (self.buses.rings.mistakes)(self.file, profile, &lines) {
            match span {
                Some(span) => self.add(&place(span), &problem),
                None => self.add(&["rig".into(), "profile".into()], &problem),
            }
        }
    }

    /// Adds a mistake at a value of the rig's file.
    pub fn add(&mut self, path: &[PathStep<'_>], problem: &Problem) {
        let span = self.place(path);
        self.problems.push(Problem {
            span,
            ..problem.clone()
        });
    }
}
