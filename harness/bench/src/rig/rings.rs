//! Rings by their sizes: what a command line, the name of a simulated bench and the record of a run say of them.

use harness_proto::novobus::address::RingSize;

/// The size of a ring.
///
/// # Errors
/// What is wrong, in a sentence.
pub fn ring_size(text: &str) -> Result<u8, String> {
    let number = text
        .parse()
        .map_err(|_| format!("`{text}` is not a number of drives: 1 to 250 expected (ND21 8.4)"))?;
    RingSize::new(number)
        .map(RingSize::drives)
        .map_err(|error| error.to_string())
}

/// The rings of a bench that have these numbers of drives.
///
/// # Errors
/// What is wrong, in a sentence.
pub fn rings(sizes: &[u8]) -> Result<Vec<RingSize>, String> {
    if !(1..=2).contains(&sizes.len()) {
        return Err("a bench has one ring or two (ND21 12.2)".to_owned());
    }
    let ring = |size: &u8| RingSize::new(u64::from(*size)).map_err(|error| error.to_string());
    sizes.iter().map(ring).collect()
}

/// The sizes of the rings of `sim:N` and `sim:N,M`, given what stands behind the colon.
///
/// # Errors
/// What is wrong, in a sentence.
pub(crate) fn sizes_of_rings(text: &str) -> Result<Vec<u8>, String> {
    let sizes: Vec<_> = text.split(',').map(ring_size).collect::<Result<_, _>>()?;
    rings(&sizes)?;
    Ok(sizes)
}

/// The file of a simulated bench, made from the sizes of its rings.
pub(crate) fn simulated_rings(sizes: &str) -> Result<String, String> {
    let sizes = sizes_of_rings(sizes)?;
    let ring = |number: usize| {
        let drives = sizes[number];
        let prefix = ["", "2:"][number];
        (
            format!(
                "[ring.{}]\ndrives = {drives}\ntransport = \"sim\"\n",
                number + 1
            ),
            format!("\"drive {prefix}0..last input GPIN3 GPIN5 high\""),
        )
    };
    let (rings, setups): (Vec<_>, Vec<_>) = (0..sizes.len()).map(ring).unzip();
    let id: Vec<_> = sizes.iter().map(u8::to_string).collect();
    Ok(format!(
        "schema = 1\n[rig]\nid = \"sim-{}\"\n{}[sim]\nsetup = [{}]\n[limits]\nallow_motion = true\nallow_eeprom = true\nallow_reset = true\nallow_outputs = true\nallow_monitoring = true\n",
        id.join("-"),
        rings.concat(),
        setups.join(", ")
    ))
}
