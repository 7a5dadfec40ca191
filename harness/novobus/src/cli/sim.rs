//! `drivebench sim`: simulated rings for anyone's master.

use super::rig;
use crate::rig::sim::RigOfRings as _;
use crate::serve::Server;
use crate::simulate::bench;
use harness_bench::bus::Served;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::rig_name::RigName;
use harness_bench::command::sim::{SimArguments, SimSpeed, options, places};
use harness_bench::rig::buses::RigBuses;
use harness_bench::serve::{ClientRole, Inner, Pace, ServedAt, serve};

/// The seats at inner links with their places, in the order of the command line: taps first.
fn inner(arguments: &SimArguments, sizes: &[u8]) -> Result<Vec<(Inner, ServedAt)>, Failure> {
    let mut all: Vec<(Inner, ServedAt)> = Vec::new();
    let taps = arguments
        .tap
        .iter()
        .map(|place| (place, &[ClientRole::Tap][..]));
    let cuts = arguments.cut.iter().map(|place| match place.places.len() {
        1 => (place, &[ClientRole::Cut][..]),
        _ => (place, &[ClientRole::Upstream, ClientRole::Downstream][..]),
    });
    for (given, roles) in taps.chain(cuts) {
        let text = &given.text;
        let refused = |why: &str| Failure::refused(format!("{text}: {why}"));
        let drives = *sizes
            .get(given.ring)
            .ok_or_else(|| refused("the bench has one ring"))?;
        let Some(from) = given.link.from.filter(|_| given.link.to.is_some()) else {
            return Err(refused(
                "the master's own links are the ring's port; a link between two drives expected",
            ));
        };
        if !given.link.is_in(drives) {
            return Err(refused(&format!(
                "a ring of {drives} has no such link; bytes go from a drive to the next lower one"
            )));
        }
        let link = usize::from(drives - from);
        if all
            .iter()
            .any(|(other, _)| (other.ring, other.link) == (given.ring, link))
        {
            return Err(refused("another --tap or --cut uses this link already"));
        }
        if given.places.len() != roles.len() {
            return Err(refused(
                "one place expected for a tap, one or two for a cut",
            ));
        }
        for (&role, place) in roles.iter().zip(&given.places) {
            let ring = given.ring;
            all.push((Inner { ring, link, role }, place.clone()));
        }
    }
    Ok(all)
}

/// Serves the rings of a simulated bench.
pub(crate) fn rings(
    arguments: &SimArguments,
    buses: &'static RigBuses,
    output: &mut Output,
) -> Served {
    if !arguments.frames.places().is_empty() {
        return Err(Failure::refused(
            "--slcan, --slcan-pty and --socketcand serve a CAN bus; --bus unitek expected with them",
        ));
    }
    if arguments.frames.slaves.is_some() {
        return Err(Failure::refused(
            "--slaves are those of a PROFIBUS segment; --bus nordac expected with it",
        ));
    }
    let (plan, link) = match &arguments.rig.rig {
        Some(RigName::Named(name)) => {
            rig::without_setup(&arguments.rig)?;
            let rig = rig::find_rig(name, buses, output).ok_or(Failure::Told(Exit::Usage))?;
            let plan = rig.plan()?;
            let mut link = bench(&plan);
            link.stop_recording();
            (plan, link)
        }
        sizes => rig::link(&arguments.rig, sizes.as_ref().and_then(RigName::sizes))?,
    };
    let pace = match arguments.pace {
        SimSpeed::Line => Pace::Line,
        SimSpeed::Free => Pace::Free,
    };
    let sizes: Vec<u8> = plan.rings.iter().map(|ring| ring.drives()).collect();
    let inner = inner(arguments, &sizes)?;
    let mut server = Server::new(plan, link, pace, arguments.marks);
    inner.iter().for_each(|(inner, _)| server.add(*inner));
    let inner = inner.into_iter().map(|(_, place)| place);
    let places = places(arguments, sizes.len()).chain(inner);
    let options = options(arguments, places.collect());
    Ok(serve(server, &options, output))
}
