//! What the profile of a rig's file says of UNITEK drives.

use super::known::KnownDrives;
use crate::driver::Error;
use crate::language::Unitek;
use crate::language::plan::{node, octet_time};
use crate::language::syntax::{PropertyValue, SetupKind};
use harness_bench::rig::Rig;
use harness_bench::scenario::expression::Scope;
use harness_bench::scenario::parse::header::{Part, read};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::syntax::Scenario;
use harness_proto::can::BitRate;
use harness_proto::unitek::properties::{Accepts, Setting, UnitekProperty};

/// The properties of drives that a profile says: the number of the drive, the property and its value.
#[derive(Clone, Debug, Default)]
pub(super) struct ProfileSettings(Vec<(u8, &'static UnitekProperty, PropertyValue)>);

impl ProfileSettings {
    /// The settings of a rig's profile; empty where its file names none.
    pub(super) fn of(rig: &Rig) -> Self {
        let Some(profile) = &rig.profile else {
            return Self::default();
        };
        let source = Source::new("profile", profile.lines.join("\n"));
        // The file was checked.
        let read: Result<Scenario<Unitek>, Problems> = read(&source, Part::Header);
        let lines = read.map_or_else(|_| Vec::new(), |scenario| scenario.header.drives);
        let properties = lines.into_iter().filter_map(|line| match line.what {
            SetupKind::Property(property, value) => {
                Some((node(&line.drive, Scope::default()).ok()?, property, value))
            }
            _ => None,
        });
        Self(properties.collect())
    }

    /// Settles the properties of a drive.
    ///
    /// # Errors
    /// The drive has shown another value: the profile is of another drive. How long something takes is not compared.
    pub(super) fn settle(&self, known: &mut KnownDrives, rate: BitRate) -> Result<(), Error> {
        let stated = self.0.iter().filter(|line| line.0 == known.axis.node);
        for (drive, property, value) in stated {
            let setting = match value {
                PropertyValue::Word(word) => Setting::Word(word),
                PropertyValue::Time(time) => Setting::Time(time.on(octet_time(rate))),
            };
            let before = known.properties;
            let _fits = property.set(&mut known.properties, setting);
            let time = matches!(property.accepts, Accepts::TimeUpTo(_));
            if !known.settled.insert(property.name) && !time && known.properties != before {
                return Err(Error::OtherThanProfile {
                    node: *drive,
                    property: property.name,
                    says: property.of_drive(&known.properties).to_string(),
                    shows: property.of_drive(&before).to_string(),
                });
            }
        }
        Ok(())
    }
}
