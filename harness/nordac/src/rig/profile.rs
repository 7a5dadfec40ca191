//! What the profile of a rig's file says of NORDAC inverters.

use super::known::KnownInverters;
use super::talk::TalkError;
use crate::language::Nordac;
use crate::language::plan::address;
use crate::language::syntax::SetupKind;
use harness_bench::rig::Rig;
use harness_bench::scenario::expression::Scope;
use harness_bench::scenario::parse::header::{Part, read};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::syntax::Scenario;
use harness_proto::nordac::properties::{NordacProperty, Properties};

/// The properties of slaves that a profile says: the address of the slave, the property and its value.
#[derive(Clone, Debug, Default)]
pub(super) struct ProfileSettings(Vec<(u8, &'static NordacProperty, String)>);

impl ProfileSettings {
    /// The settings of a rig's profile; empty where its file names none.
    pub(super) fn of(rig: &Rig) -> Self {
        let Some(profile) = &rig.profile else {
            return Self::default();
        };
        let source = Source::new("profile", profile.lines.join("\n"));
        // The file was checked.
        let read: Result<Scenario<Nordac>, Problems> = read(&source, Part::Header);
        let lines = read.map_or_else(|_| Vec::new(), |scenario| scenario.header.slaves);
        let properties = lines.into_iter().filter_map(|line| match line.what {
            SetupKind::Property(property, word) => {
                Some((address(&line.slave, Scope::default()).ok()?, property, word))
            }
            _ => None,
        });
        Self(properties.collect())
    }

    /// Settles the properties of a slave.
    ///
    /// # Errors
    /// No value that the slave can have is that of the profile: it is of another slave.
    pub(super) fn settle(&self, known: &mut KnownInverters) -> Result<(), TalkError> {
        let slave = known.slave.address;
        for (_, property, word) in self.0.iter().filter(|row| row.0 == slave) {
            let has = |properties: Properties| {
                let mut other = properties;
                property.set(&mut other, word) && other == properties
            };
            let candidates = known.open.iter().map(|(_, properties)| *properties);
            let mut possible = std::iter::once(known.properties).chain(candidates);
            if !possible.any(has) {
                return Err(TalkError::OtherThanProfile {
                    slave,
                    property: property.name,
                    says: word.clone(),
                });
            }
            let _fits = property.set(&mut known.properties, word);
            let named = format!("{} = ", property.name);
            known.open.retain(|(words, _)| !words.starts_with(&named));
            for (_, properties) in &mut known.open {
                let _fits = property.set(properties, word);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::RigSlave;
    use harness_proto::nordac::properties::PROPERTIES;

    /// A value that is possible is taken over, and the point is open no more; one that the slave has not is refused.
    #[test]
    fn what_is_possible_is_taken_over() {
        let slave = RigSlave {
            address: 8,
            ppo: None,
        };
        let fresh = KnownInverters::new(slave);
        for property in PROPERTIES {
            let named = format!("{} = ", property.name);
            let mut open = fresh.open.iter();
            let word = open.find_map(|(words, _)| words.strip_prefix(&named));
            let word = word.expect("another value").to_owned();
            let profile = ProfileSettings(vec![(8, property, word.clone())]);
            let mut known = fresh.clone();
            profile.settle(&mut known).expect("possible");
            assert_ne!(known.properties, fresh.properties, "{named}{word}");
            assert!(known.open.iter().all(|point| !point.0.starts_with(&named)));
            let kept = known.open.iter().all(|(_, properties)| {
                let mut other = *properties;
                property.set(&mut other, &word) && other == *properties
            });
            assert!(kept, "{named}{word}");
            let mut shown = fresh.clone();
            shown.open.clear();
            let refused = profile.settle(&mut shown).expect_err("another value");
            assert!(refused.to_string().contains("qualify this one"));
        }
    }
}
