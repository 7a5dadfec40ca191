//! What a page shows beside what a command printed. A line `...` stands for any lines, `...` in a line for any text.

/// Whether what is shown is what was printed.
pub(super) fn fits(shown: &[String], printed: &[String]) -> bool {
    let gap = |line: &String| line == "...";
    glob(shown, printed, gap, |shown, printed| {
        line_fits(shown, printed)
    })
}

/// The same of one line.
pub(super) fn line_fits(shown: &str, printed: &str) -> bool {
    if !shown.contains("...") {
        return shown.trim_end() == printed.trim_end();
    }
    let (shown, mut rest) = (shown.trim_end(), printed.trim_end());
    let parts: Vec<_> = shown.split("...").collect();
    let (first, last) = (parts[0], parts[parts.len() - 1]);
    if !rest.starts_with(first) {
        return false;
    }
    rest = &rest[first.len()..];
    for part in &parts[1..parts.len() - 1] {
        match rest.find(part) {
            Some(place) => rest = &rest[place + part.len()..],
            None => return false,
        }
    }
    rest.ends_with(last)
}

/// Whether a list fits a pattern with gaps: what stands between gaps is looked for from the left.
fn glob<T>(
    pattern: &[T],
    list: &[T],
    gap: impl Fn(&T) -> bool,
    fits: impl Fn(&T, &T) -> bool,
) -> bool {
    let parts: Vec<&[T]> = pattern.split(gap).collect();
    let at = |part: &[T], place: usize| {
        let piece = list.get(place..place + part.len());
        piece.is_some_and(|piece| part.iter().zip(piece).all(|(a, b)| fits(a, b)))
    };
    if parts.len() == 1 {
        return pattern.len() == list.len() && at(pattern, 0);
    }
    let (first, last) = (parts[0], parts[parts.len() - 1]);
    if !at(first, 0) {
        return false;
    }
    let mut place = first.len();
    for part in &parts[1..parts.len() - 1] {
        match (place..=list.len()).find(|place| at(part, *place)) {
            Some(found) => place = found + part.len(),
            None => return false,
        }
    }
    list.len() >= place + last.len() && at(last, list.len() - last.len())
}
