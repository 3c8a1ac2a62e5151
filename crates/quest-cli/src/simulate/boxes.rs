//! The boxes that points and translations are drawn from, as the command line writes them.

/// The boxes of [`quest_core::simulate::Boxes::default`].
pub(super) const POINTS: &str = "-1,1,-1,1,2,4";
pub(super) const TRANSLATION: &str = "1,1,1";

/// `x0,x1,y0,y1,z0,z1`.
pub(super) fn points(text: &str) -> Result<[[f64; 2]; 3], String> {
    let [x0, x1, y0, y1, z0, z1] =
        numbers(text, "the least and the largest x, y and z, such as -1,1,-1,1,2,4")?;
    Ok([[x0, x1], [y0, y1], [z0, z1]])
}

/// `x,y,z`.
pub(super) fn translation(text: &str) -> Result<[f64; 3], String> {
    numbers(text, "the largest x, y and z, such as 1,1,1")
}

fn numbers<const N: usize>(text: &str, expected: &str) -> Result<[f64; N], String> {
    let found = text.split(',').map(|field| field.trim().parse().ok()).collect::<Option<Vec<f64>>>();
    let found = found.filter(|numbers| numbers.iter().all(|x| x.is_finite()));
    found
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| format!("found {text:?}, expected {expected}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use quest_core::simulate::Boxes;

    #[test]
    fn the_defaults_are_those_of_the_core() {
        let boxes = Boxes { points: points(POINTS).unwrap(), translation: translation(TRANSLATION).unwrap() };
        assert_eq!(boxes, Boxes::default());
        assert!(points("1,2,3").is_err() && translation("1,1,inf").is_err() && translation("a").is_err());
    }
}
