//! What the commands ask of conversations with the drives of a bus, to explore them.

use super::run::FuzzRunArguments;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::explore::smaller::{Shrinkable, Subject};
use crate::explore::{ExploreError, Finding, FuzzCase, FuzzSettings, Planted, Spiced as _, Target};
use crate::rig::{Rig, UseOptions};
use std::path::Path;

/// What is done with the drives of a rig with ports: with a target, what conversations on them may have, and what their model is made of.
pub type PortWork<'w, C> =
    dyn FnMut(&mut dyn Target<C>, PortScope<C>, &mut Output) -> std::io::Result<Exit> + 'w;

/// What conversations may have, and what the model of the drives is made of.
pub type PortScope<C> = (<C as FuzzCase>::Scope, <C as FuzzCase>::Setup);

/// A conversation that `fuzz` and `shrink` play.
pub trait ExploredCase: Shrinkable {
    /// Why a run is not possible.
    fn refused(rig: &Rig, arguments: &FuzzRunArguments) -> Option<String>;

    /// Plants deviations in the simulated drives of a rig that is tried like one with ports.
    fn plant(rig: &mut Rig, planted: &[Planted]);

    /// What the simulated drives of a rig are made of.
    fn setup(rig: &Rig, arguments: Option<&FuzzRunArguments>) -> Self::Setup;

    /// What conversations with simulated drives may have: what the rig's file permits, or `everything`.
    fn scope(rig: &Rig, setup: &Self::Setup, everything: bool) -> Self::Scope;

    /// Simulated drives: those of a rig, or those that each conversation needs.
    ///
    /// # Errors
    /// The drives cannot be made.
    fn simulated(
        setup: &Self::Setup,
        rig: Option<&Rig>,
    ) -> Result<Box<dyn Target<Self>>, ExploreError>;

    /// Works on the drives of a rig with ports, and gives the rig back in its safe state.
    ///
    /// # Errors
    /// The output cannot be written.
    fn on_ports(
        rig: &Rig,
        options: &UseOptions,
        output: &mut Output,
        work: &mut PortWork<'_, Self>,
    ) -> std::io::Result<Exit>;

    /// What conversations on a rig with ports do not have, in a line; empty if nothing is to be said.
    fn left_out(_rig: &Rig, _allow_motion: bool) -> String {
        String::new()
    }

    /// The numbers of drives, and what conversations may have.
    fn parts(scope: &Self::Scope) -> ((u8, Option<u8>), &[Self::Spice]);

    /// The conversations of a folder that suit a rig.
    ///
    /// # Errors
    /// The folder cannot be read, or a file of it is damaged.
    fn kept(folder: &Path, rig: &Rig) -> Result<Vec<Self>, ExploreError>;

    /// What a rig lacks where a folder has no conversation for it: `case of UNITEK drives`.
    fn missing(rig: &Rig) -> String;

    /// How large it is, in the unit of its bus.
    fn size(&self) -> (usize, &'static str);

    /// Why a finding cannot be of a rig with ports.
    fn is_of_another(finding: &Finding<Self>, rig: &Rig) -> Option<String>;

    /// Whether it is with as many drives as another one.
    fn has_drives_of(&self, _other: &Self) -> bool {
        true
    }

    /// Simulated drives, each with its words, that may show what a finding on a rig shows: it is made small on the first that do, and what
    /// comes of it is tried on the rig.
    fn suspects(_finding: &Finding<Self>) -> Vec<(String, Subject<Self>)> {
        Vec::new()
    }
}

/// The settings of a run.
pub fn settings<C: ExploredCase>(
    (rig, ports): (&str, bool),
    (scope, setup): (&C::Scope, C::Setup),
    (seed, (confirm, of)): (u64, (u8, u8)),
) -> FuzzSettings<C> {
    let ((drives, second), spices) = C::parts(scope);
    let names = spices.iter().map(|spice| spice.name().to_owned());
    FuzzSettings {
        schema: FuzzSettings::<C>::SCHEMA,
        rig: rig.to_owned(),
        drives,
        second,
        ports,
        seed,
        confirm,
        of,
        setup,
        spices: names.collect(),
    }
}
