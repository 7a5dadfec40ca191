//! The manual of PROFIBUS DP for NORDAC *vector*.

use harness_bench::bus_name::BusName;
use harness_bench::manual::{Manual, Open};
use harness_proto::nordac::properties::{Choices, PROPERTIES};

/// The manual of PROFIBUS DP for NORDAC *vector*.
pub(crate) const MANUAL: Manual = Manual {
    bus: BusName::Nordac,
    title: "NORDAC vector PROFIBUS DP manual",
    document: "nordac",
    tables: include_str!("../../../corpora/manual/nordac-tables.toml"),
    errata: include_str!("../../../corpora/manual/nordac-errata.toml"),
    open,
};

fn open() -> Vec<Open> {
    let properties = PROPERTIES.iter().map(|property| Open {
        section: property.section,
        name: property.name,
        values: match property.accepts {
            Choices::Words(words) => words.join(" or "),
            Choices::Count {
                least,
                default,
                most,
            } => format!("{default}, or another number from {least} to {most}"),
        },
        about: property.about,
    });
    properties.collect()
}
