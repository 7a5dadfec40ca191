//! Shares of the cases of a campaign.

/// A share of all cases, to a hundredth of a percent; a share that is not nothing does not look like it.
#[must_use]
pub fn share(part: u64, all: u64) -> String {
    if all == 0 {
        return "-".to_owned();
    }
    let hundredths = (u128::from(part) * 20_000 / u128::from(all)).div_ceil(2);
    if hundredths == 0 && part > 0 {
        return "< 0.01 %".to_owned();
    }
    format!("{}.{:02} %", hundredths / 100, hundredths % 100)
}
