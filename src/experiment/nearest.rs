//! The known name nearest to a misspelt one.

/// The nearest of the known names, or none when all are too far to be meant.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |text: &str| text.to_lowercase().replace(['_', ' ', '.'], "-");
    let wanted = plain(name);
    let longest = wanted.chars().count();
    known
        .into_iter()
        .map(|candidate| {
            let plain = plain(candidate);
            let distance = strsim::damerau_levenshtein(&wanted, &plain);
            // Up to a third of the letters may be slips; a longer difference may still be an abbreviation.
            let abbreviated = longest >= 3 && (plain.starts_with(&wanted) || wanted.starts_with(&plain));
            let near = distance <= 1.max(longest.max(plain.chars().count()) / 3);
            (candidate, distance, near || abbreviated)
        })
        .filter(|(_, _, near)| *near)
        .min_by_key(|(_, distance, _)| *distance)
        .map(|(candidate, _, _)| candidate)
}

/// `did you mean "stretch"?`, or the known names when none is near.
pub fn suggestion<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let known: Vec<&str> = known.into_iter().collect();
    if let Some(name) = nearest(name, known.iter().copied()) {
        return Some(format!("did you mean \"{name}\"?"));
    }
    match known.len() {
        0 => None,
        1..=24 => Some(format!("known: {}", known.join(", "))),
        many => Some(format!("known: {}, ... ({many} in all)", known[..24].join(", "))),
    }
}
