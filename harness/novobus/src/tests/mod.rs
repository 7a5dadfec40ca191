//! The bus in virtual time: the codec, the driver, the language, the guard and the twin on simulated rings.

mod blind;
mod busy;
mod campaigns;
mod deviations;
mod driver;
mod explore;
mod guard;
mod language;
mod naming;
mod served;
mod top;
mod twin;
mod vectors;

use harness_bench::bus_name::BusName;
use harness_bench::scenario::files::sources;
use harness_bench::scenario::parse::bus;
use harness_bench::scenario::source::Source;

/// The folder with `corpora` and `snapshots`.
const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// The built-in scenarios of this bus.
fn built_in_sources() -> impl Iterator<Item = Source> {
    let all = sources(&[]).expect("the built-in scenarios").into_iter();
    all.filter(|source| bus(source) == BusName::Novobus)
}
