//! The known name nearest to a misspelt one.

/// The nearest of the known names, or none when all are too far to be meant.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |text: &str| text.to_lowercase().replace(['_', ' ', '.'], "-");
    let wanted = plain(name);
    let letters = wanted.chars().count();
    known
        .into_iter()
        .map(|candidate| {
            let plain = plain(candidate);
            let distance = strsim::damerau_levenshtein(&wanted, &plain);
            // Up to a third of the letters may be slips; a longer difference may still be an abbreviation.
            let abbreviated = letters >= 3 && (plain.starts_with(&wanted) || wanted.starts_with(&plain));
            let longest = letters.max(plain.chars().count());
            let near = distance <= 1.max(longest / 3) && distance < longest;
            (candidate, distance, near || abbreviated)
        })
        .filter(|(_, _, near)| *near)
        .min_by_key(|(_, distance, _)| *distance)
        .map(|(candidate, _, _)| candidate)
}

/// The known names of which a word is the given one: `surface` is in `g1-surface` and in `surface-fit`.
fn containing<'a>(name: &str, known: &[&'a str]) -> Vec<&'a str> {
    let word = |candidate: &&&str| {
        candidate
            .split(['-', '_', '.'])
            .any(|part| part.eq_ignore_ascii_case(name))
    };
    known.iter().filter(word).copied().collect()
}

/// `did you mean "stretch"?`, or the known names when none is near.
pub fn suggestion<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let known: Vec<&str> = known.into_iter().collect();
    let several = containing(name, &known);
    if let [first, .., last] = several[..] {
        let between = several[1..several.len() - 1].iter().map(|name| format!(", \"{name}\""));
        return Some(format!(
            "did you mean \"{first}\"{} or \"{last}\"?",
            between.collect::<String>()
        ));
    }
    match nearest(name, known.iter().copied()).or(several.first().copied()) {
        Some(name) => Some(format!("did you mean \"{name}\"?")),
        None => list(&known),
    }
}

/// The known names, as far as a line or two hold them; none when there are none.
pub fn list(known: &[&str]) -> Option<String> {
    match known.len() {
        0 => None,
        1..=24 => Some(format!("known: {}", known.join(", "))),
        many => Some(format!("known: {}, ... ({many} in all)", known[..24].join(", "))),
    }
}
