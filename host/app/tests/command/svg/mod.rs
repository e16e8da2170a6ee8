//! Charts read back: what is drawn where.

/// Drawing in the panel of that name.
pub(crate) fn panel<'a>(page: &'a str, name: &str) -> &'a str {
    let (_, rest) = page
        .split_once(&format!("data-figure=\"{name}\""))
        .unwrap_or_else(|| panic!("no panel {name}"));
    let (_, content) = rest.split_once('>').expect("a tag");
    content.split_once("</svg>").expect("it ends").0
}

/// Values of an attribute of every element with a class.
pub(crate) fn of_class<'a>(svg: &'a str, class: &str, attribute: &str) -> Vec<&'a str> {
    let elements = svg.split('<').filter(|element| element.contains(&format!("class=\"{class}\"")));
    elements
        .map(|element| {
            let (_, rest) = element.split_once(&format!(" {attribute}=\"")).expect(attribute);
            rest.split_once('"').expect("its end").0
        })
        .collect()
}

pub(crate) fn number(text: &str) -> f64 {
    text.parse().unwrap_or_else(|_| panic!("{text} is a number"))
}

/// Corners of the only line of a class.
pub(crate) fn line(svg: &str, class: &str) -> Vec<[f64; 2]> {
    let [points] = of_class(svg, class, "points")[..] else { panic!("one line {class}: {svg}") };
    let corner = |pair: &str| {
        let (x, y) = pair.split_once(',').expect("x,y");
        [number(x), number(y)]
    };
    points.split_whitespace().map(corner).collect()
}

/// Positions of labels with a number, by their number: of the axis at the left, or below.
pub(crate) fn ticks(svg: &str, is_left: bool) -> Vec<(f64, [f64; 2])> {
    let texts = svg.split("<text ").skip(1).filter(|text| text.contains("class=\"tick\""));
    let place = |tag: &str, name: &str| {
        let found = tag.split(' ').find_map(|word| word.strip_prefix(&format!("{name}=\"")));
        number(found.expect(name).trim_end_matches('"'))
    };
    texts
        .filter(|text| text.contains("text-anchor=\"end\"") == is_left)
        .filter_map(|text| {
            let (tag, rest) = text.split_once('>')?;
            let value = rest.split_once("</text>")?.0.trim().parse().ok()?;
            Some((value, [place(tag, "x"), place(tag, "y")]))
        })
        .collect()
}

/// Value at a place across on a logarithmic axis of which two marks are known.
pub(crate) fn log_value(ticks: &[(f64, [f64; 2])], x: f64) -> f64 {
    let [(low, [left, _]), .., (high, [right, _])] = ticks else { panic!("two ticks") };
    low * (high / low).powf((x - left) / (right - left))
}
