//! How a simulated drive is set up before power-up.

use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::Properties;

/// How a simulated drive is set up before power-up.
#[derive(Clone, Debug, Default)]
pub struct InverterSetup {
    /// What the manual leaves open.
    pub properties: Properties,
    /// Whether the PosiCon option is fitted, and its parameters exist (5.6).
    pub posicon: bool,
    /// Parameters that are stored already: number, set and element, value. The others have their factory settings, and so have
    /// those whose value does not fit their 16 or 32 bits. The limits do not count here.
    pub parameters: Vec<(u16, Index, i32)>,
}
