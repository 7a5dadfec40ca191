//! How the drives of a shared line are explored.

use super::case::{ExploredCase, PortWork};
use super::replay;
use super::run::FuzzRunArguments;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::rig_failure::{exit_of, exit_of_end, tell_end};
use crate::explore::line::{LineRig, LineScope, LineSetup, LineTalk, OnAdapter, OnLine, SessionOf};
use crate::explore::{ExploreError, Finding, Planted, Spiced as _, Target};
use crate::link::Line as _;
use crate::rig::{Rig, UseOptions};
use std::collections::BTreeMap;
use std::path::Path;

impl<B: LineRig> ExploredCase for LineTalk<B> {
    fn refused(_: &Rig, arguments: &FuzzRunArguments) -> Option<String> {
        let (drives, bus) = (B::DRIVES, B::BUS.name());
        if arguments.whole {
            return Some(format!("--whole is for rings; leave it out for {drives}"));
        }
        let mut planted = arguments.deviates.iter();
        let second = planted.any(|drive| drive.ring != 0);
        second.then(|| {
            format!(
                "a deviation of {drives} is planted as NUMBER=NAME; `drivebench deviations --bus {bus}` lists the names"
            )
        })
    }

    fn plant(rig: &mut Rig, planted: &[Planted]) {
        if let Some(sim) = &mut rig.file.sim {
            sim.setup.extend(planted.iter().map(Planted::line::<B>));
        }
    }

    fn setup(rig: &Rig, arguments: Option<&FuzzRunArguments>) -> LineSetup {
        let planted = arguments.map_or_else(Vec::new, |arguments| arguments.deviates.clone());
        LineSetup::of_rig::<B>(rig, &B::stations(rig, None), planted)
    }

    fn scope(rig: &Rig, _: &LineSetup, _everything: bool) -> LineScope<B> {
        LineScope {
            drives: B::stations(rig, None),
            spices: B::Spice::ALL.iter().map(|(_, spice)| *spice).collect(),
        }
    }

    fn simulated(
        setup: &LineSetup,
        _: Option<&Rig>,
    ) -> Result<Box<dyn Target<Self>>, ExploreError> {
        Ok(Box::new(OnLine::<B>::new(setup.under_test::<B>()?)))
    }

    fn on_ports(
        rig: &Rig,
        options: &UseOptions,
        output: &mut Output,
        work: &mut PortWork<'_, Self>,
    ) -> std::io::Result<Exit> {
        let mut session = match SessionOf::<B>::open(rig, options) {
            Ok(session) => session,
            Err(error) => {
                output.complain(&error.to_string());
                return Ok(exit_of(&error));
            }
        };
        let all = B::Spice::ALL.iter().map(|(_, spice)| *spice);
        let scope = LineScope::<B> {
            drives: B::stations(rig, Some(&session)),
            spices: all
                .filter(|spice| B::lacks(rig, options.allow_motion, *spice).is_none())
                .collect(),
        };
        let mut setup = LineSetup::of_rig::<B>(rig, &scope.drives, Vec::new());
        // What they are, only the drives themselves show.
        setup.deviates.clear();
        let target = setup
            .under_test::<B>()
            .and_then(|model| OnAdapter::<B>::new(&mut session, model));
        let worked = match target {
            Ok(mut target) => {
                let exit = work(&mut target, (scope, setup), output);
                for remark in target.restore() {
                    output.complain(&remark);
                }
                exit
            }
            Err(error) => Ok(super::tell(&error, output)),
        };
        let exit = worked.unwrap_or_else(|error| output.unwritable(&error));
        session.end_if_overdue();
        let exit = exit_of_end(session.link().trouble(), exit, output);
        let end = session.close(matches!(exit, Exit::RigError | Exit::Interlock));
        Ok(tell_end(&end, exit, output))
    }

    /// What they lack, with the limit that would permit it.
    fn left_out(rig: &Rig, allow_motion: bool) -> String {
        let mut left: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for (name, spice) in B::Spice::ALL {
            if let Some(why) = B::lacks(rig, allow_motion, *spice) {
                left.entry(why).or_default().push(name);
            }
        }
        let each = left
            .iter()
            .map(|(why, names)| format!("{} ({why})", names.join(", ")));
        let each: Vec<_> = each.collect();
        match each.is_empty() {
            true => String::new(),
            false => format!("not in the conversations: {}\n", each.join("; ")),
        }
    }

    fn parts(scope: &LineScope<B>) -> ((u8, Option<u8>), &[B::Spice]) {
        let drives = u8::try_from(scope.drives.len()).unwrap_or(u8::MAX);
        ((drives, None), &scope.spices)
    }

    fn kept(folder: &Path, _: &Rig) -> Result<Vec<Self>, ExploreError> {
        replay::kept(folder)
    }

    fn missing(_: &Rig) -> String {
        format!("case of {}", B::DRIVES)
    }

    fn size(&self) -> (usize, &'static str) {
        (self.acts.len(), "act")
    }

    fn is_of_another(_: &Finding<Self>, rig: &Rig) -> Option<String> {
        let is_same = rig.port().map(|port| port.bus.bus()) == Some(B::BUS);
        (!is_same).then(|| B::DRIVES.to_owned())
    }
}
