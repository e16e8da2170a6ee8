//! Sets as words of bits, the lowest bit of the first word first.

/// Members to a word.
pub(crate) const WORD: usize = u64::BITS as usize;

/// Indices of the ones in a word, ascending.
pub(crate) fn ones(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = word.trailing_zeros() as usize;
        word &= word.wrapping_sub(1);
        (bit < WORD).then_some(bit)
    })
}

/// The members of a set, ascending.
pub(crate) fn members(words: &[u64]) -> impl Iterator<Item = usize> {
    words
        .iter()
        .enumerate()
        .flat_map(|(index, &word)| ones(word).map(move |bit| index * WORD + bit))
}

/// Count of the members of a set.
pub(crate) fn count(words: &[u64]) -> usize {
    words.iter().map(|word| word.count_ones() as usize).sum()
}
