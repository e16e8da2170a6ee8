//! Places of a text on a page, with its first and last numbers whole.

use std::ops::Range;

/// True when a page prints a text.
pub(super) fn prints(page: &str, text: &str) -> bool {
    places(page, text).next().is_some()
}

/// The page with a text replaced by another; `None` when it does not print it.
pub(super) fn replace(page: &str, old: &str, new: &str) -> Option<String> {
    let places: Vec<_> = places(page, old).collect();
    let mut text = page.to_owned();
    for place in places.iter().rev() {
        text.replace_range(place.clone(), new);
    }
    (!places.is_empty()).then_some(text)
}

/// Places where a page prints a text: "5.0 %" does not stand in "25.0 %".
fn places(page: &str, text: &str) -> impl Iterator<Item = Range<usize>> {
    page.match_indices(text)
        .map(|(begin, found)| begin..begin + found.len())
        .filter(|place| !begins_inside(page, place.start) && !ends_inside(page, place.end))
}

/// True when a place lies inside a number that began before it. A sign belongs to a number.
fn begins_inside(page: &str, at: usize) -> bool {
    let mut before = page[..at].chars().rev();
    page[at..].starts_with(digit)
        && match before.next() {
            Some('.' | '-' | '−') => true,
            Some(',') => before.next().is_some_and(digit),
            before => before.is_some_and(digit),
        }
}

/// True when a place is inside a number. A point may end a sentence.
fn ends_inside(page: &str, at: usize) -> bool {
    let mut after = page[at..].chars();
    page[..at].ends_with(digit)
        && match after.next() {
            Some('.' | ',') => after.next().is_some_and(digit),
            after => after.is_some_and(digit),
        }
}

fn digit(character: char) -> bool {
    character.is_ascii_digit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_that_begins_inside_a_number_is_not_printed() {
        for page in ["25.0 % by", "1,5.0 % by", "3.5.0 % by", "-5.0 % by", "x 105.0 % by"] {
            assert!(!prints(page, "5.0 % by"), "{page}");
        }
        for page in ["5.0 % by", "a 5.0 % by", "|5.0 % by", "either,5.0 % by", "95.0 %, 5.0 % by"] {
            assert!(prints(page, "5.0 % by"), "{page}");
        }
    }

    #[test]
    fn a_text_that_ends_inside_a_number_is_not_printed() {
        for page in ["costs 190", "costs 19.2", "costs 19,200"] {
            assert!(!prints(page, "costs 19"), "{page}");
        }
        for page in ["costs 19", "costs 19.", "costs 19, and", "costs 19 %"] {
            assert!(prints(page, "costs 19"), "{page}");
        }
    }

    #[test]
    fn only_whole_numbers_are_replaced() {
        let page = "25.0 % by chance, 5.0 % by luck, 5.0 % by day";
        let new = replace(page, "5.0 % by", "12.5 % by").unwrap();
        assert_eq!(new, "25.0 % by chance, 12.5 % by luck, 12.5 % by day");
        assert_eq!(replace(page, "6.0 % by", "12.5 % by"), None);
    }
}
