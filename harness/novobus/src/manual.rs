//! The ND21 User Manual.

use harness_bench::bus_name::BusName;
use harness_bench::manual::{Manual, Open};
use harness_proto::novobus::properties::PROPERTIES;
use harness_sim::nd21;

/// The ND21 User Manual 1/96.
pub(crate) const MANUAL: Manual = Manual {
    bus: BusName::Novobus,
    title: "ND21 User Manual 1/96",
    document: "nd21",
    tables: include_str!("../../../corpora/manual/nd21-tables.toml"),
    errata: include_str!("../../../corpora/manual/errata.toml"),
    open,
};

fn open() -> Vec<Open> {
    let bus = PROPERTIES.iter().map(|property| Open {
        section: property.section,
        name: property.name,
        values: property.values.join(" or "),
        about: property.about,
    });
    let drive = nd21::PROPERTIES.iter().map(|property| Open {
        section: property.section,
        name: property.name,
        values: property.values(),
        about: property.about,
    });
    bus.chain(drive).collect()
}
