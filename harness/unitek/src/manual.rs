//! The UNITEK DS CAN-BUS manual.

use harness_bench::bus_name::BusName;
use harness_bench::manual::{Manual, Open};
use harness_proto::unitek::properties::{Accepts, PROPERTIES};

/// The UNITEK DS CAN-BUS manual.
pub(crate) const MANUAL: Manual = Manual {
    bus: BusName::Unitek,
    title: "UNITEK DS CAN-BUS manual",
    document: "unitek",
    tables: include_str!("../../../corpora/manual/unitek-tables.toml"),
    errata: include_str!("../../../corpora/manual/unitek-errata.toml"),
    open,
};

fn open() -> Vec<Open> {
    let properties = PROPERTIES.iter().map(|property| Open {
        section: property.section,
        name: property.name,
        values: match property.accepts {
            Accepts::Words(words) => words.join(" or "),
            Accepts::Byte => "00, or another byte".to_owned(),
            Accepts::TimeUpTo(most) => format!("a time up to {most}"),
        },
        about: property.about,
    });
    properties.collect()
}
