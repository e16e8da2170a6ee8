//! `cargo xtask surroundings`: picture of what mirrors, bright signs and another LiDAR add to a
//! scan, for `benches/record/physics.md`.

use anyhow::{Context, Result};

use crate::shell::{build_release, built, echoloop, succeed, workspace};

/// A scan with and without one of the switches.
struct Panel {
    title: &'static str,
    switch: &'static str,
    /// Scan pattern.
    pattern: &'static str,
    /// Seed of scene and viewpoint.
    seed: &'static str,
    /// Place of a point in the picture, m.
    place: fn([f32; 3]) -> (f32, f32),
    across: [f32; 2],
    up: [f32; 2],
    tick_m: f32,
    axes: &'static str,
}

const PANELS: [Panel; 3] = [
    Panel {
        title: "scene.mirrors=wet: images below the street",
        switch: "scene.mirrors=wet",
        pattern: "steered",
        seed: "11",
        place: aside,
        across: [0.0, 60.0],
        up: [-12.0, 6.0],
        tick_m: 6.0,
        axes: "horizontal distance and height, m",
    },
    Panel {
        title: "scene.retroreflectors=bright: glare beside signs, ghosts at twice the range",
        switch: "scene.retroreflectors=bright",
        pattern: "os1-64",
        seed: "21",
        place: aside,
        across: [0.0, 30.0],
        up: [-4.0, 4.0],
        tick_m: 2.0,
        axes: "horizontal distance and height, m",
    },
    Panel {
        title: "scene.interference=flash: pulses of another LiDAR, from above",
        switch: "scene.interference=flash",
        pattern: "steered",
        seed: "7",
        place: |[x, y, _]| (-y, x),
        across: [-100.0, 100.0],
        up: [-60.0, 60.0],
        tick_m: 20.0,
        axes: "to the right and ahead, m",
    },
];

fn aside([x, y, z]: [f32; 3]) -> (f32, f32) {
    (x.hypot(y), z)
}

/// Points farther than this from all of the scan without the switch are its own, m.
const APART_M: f32 = 0.3;

/// One in so many of the other points is drawn.
const THINNED: usize = 3;

/// Width of the picture, and room around a panel, pixels.
const WIDTH: f32 = 740.0;
const LEFT: f32 = 40.0;
const RIGHT: f32 = 16.0;
const HEAD: f32 = 26.0;
const FOOT: f32 = 44.0;

pub(crate) fn run() -> Result<()> {
    build_release()?;
    let drawn = PANELS.iter().map(scans).collect::<Result<Vec<_>>>()?;
    std::fs::write(workspace()?.join("docs/figures/surroundings.svg"), draw(&drawn))?;
    Ok(())
}

/// Points of a scan without a switch, and those that it adds.
type Scans = [Vec<[f32; 3]>; 2];

fn scans(panel: &Panel) -> Result<Scans> {
    let folder = built(&workspace()?).join("surroundings");
    std::fs::create_dir_all(&folder)?;
    let scan = |name: &str, more: &[&str]| -> Result<Vec<[f32; 3]>> {
        let file = folder.join(name);
        let mut command = echoloop()?;
        command.args(["scan", "--scene", "structured", "--seed", panel.seed, "--quiet"]);
        let pattern = format!("scanner.pattern={}", panel.pattern);
        command.args(["--set", "lidar.echoes=4", "--set", &pattern]).args(more);
        command.arg("-o").arg(&file);
        succeed(&mut command)?;
        points(&std::fs::read(&file)?).with_context(|| format!("{} is no scan", file.display()))
    };
    let without = scan("without.ply", &[])?;
    let with = scan("with.ply", &["--set", panel.switch])?;
    let added = added(&without, with);
    Ok([without, added])
}

/// Points of a PLY that `echoloop scan` wrote: binary, x, y and z first.
fn points(ply: &[u8]) -> Option<Vec<[f32; 3]>> {
    const END: &[u8] = b"end_header\n";
    let end = ply.windows(END.len()).position(|bytes| bytes == END)? + END.len();
    let (header, body) = ply.split_at(end);
    let header = std::str::from_utf8(header).ok()?;
    let count: usize =
        header.lines().find_map(|line| line.strip_prefix("element vertex "))?.parse().ok()?;
    let number = |bytes: &[u8]| Some(f32::from_le_bytes(bytes.try_into().ok()?));
    let point = |vertex: &[u8]| {
        Some([number(&vertex[..4])?, number(&vertex[4..8])?, number(&vertex[8..12])?])
    };
    body.chunks_exact(body.len().checked_div(count)?.max(12)).map(point).collect()
}

/// Those of `with` that are [`APART_M`] from all of `without`.
fn added(without: &[[f32; 3]], mut with: Vec<[f32; 3]>) -> Vec<[f32; 3]> {
    let near = |a: &[f32; 3], b: &[f32; 3]| {
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>() < APART_M * APART_M
    };
    with.retain(|point| !without.iter().any(|other| near(point, other)));
    with
}

/// The picture: panels below each other, in SVG.
fn draw(drawn: &[Scans]) -> String {
    let height: f32 = PANELS.iter().map(Panel::height).sum();
    let mut top = 0.0;
    let mut panels = String::new();
    for (panel, scans) in PANELS.iter().zip(drawn) {
        panels += &format!("<g transform=\"translate(0 {top})\">{}</g>", panel.draw(scans));
        top += panel.height();
    }
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" \
         font-family=\"sans-serif\" font-size=\"11\" role=\"img\"><title>Points that mirrors, \
         bright signs and another LiDAR add to a scan</title>\
         <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#fff\"/>{panels}</svg>\n"
    )
}

impl Panel {
    /// Pixels a metre: the same along both axes.
    fn scale(&self) -> f32 {
        (WIDTH - LEFT - RIGHT) / (self.across[1] - self.across[0])
    }

    fn height(&self) -> f32 {
        (HEAD + FOOT + self.scale() * (self.up[1] - self.up[0])).round()
    }

    /// Pixel of a place within the window; `None` outside.
    fn pixel(&self, (x, y): (f32, f32)) -> Option<(f32, f32)> {
        let ([left, right], [low, high]) = (self.across, self.up);
        let is_inside = (left..=right).contains(&x) && (low..=high).contains(&y);
        is_inside.then(|| (LEFT + self.scale() * (x - left), HEAD + self.scale() * (high - y)))
    }

    fn draw(&self, [without, added]: &Scans) -> String {
        let dots = |points: &[[f32; 3]], one_in: usize, colour: &str, width: f32| {
            let pixels =
                points.iter().step_by(one_in).map(|point| self.pixel((self.place)(*point)));
            let path: String = pixels.flatten().map(|(x, y)| format!("M{x:.0} {y:.0}h0")).collect();
            format!(
                "<path d=\"{path}\" stroke=\"{colour}\" stroke-width=\"{width}\" \
                 stroke-linecap=\"round\"/>"
            )
        };
        let text = |(x, y): (f32, f32), anchor: &str, words: &str| {
            format!("<text x=\"{x:.0}\" y=\"{y:.0}\" text-anchor=\"{anchor}\">{words}</text>")
        };
        let ticks = |[from, to]: [f32; 2]| {
            (0..).map(move |k| from + self.tick_m * k as f32).take_while(move |at| *at <= to)
        };
        let (bottom, middle) = (self.height() - FOOT, 0.5 * WIDTH);
        let mut svg = text((middle, 16.0), "middle", self.title);
        for at in ticks(self.across) {
            let (x, _) = self.pixel((at, self.up[0])).unwrap_or_default();
            svg += &text((x, bottom + 14.0), "middle", &at.to_string());
        }
        for at in ticks(self.up) {
            let (_, y) = self.pixel((self.across[0], at)).unwrap_or_default();
            svg += &text((LEFT - 6.0, y + 4.0), "end", &at.to_string());
        }
        let (width, inner) = (WIDTH - LEFT - RIGHT, bottom - HEAD);
        svg += &text((middle, bottom + 30.0), "middle", self.axes);
        svg += &format!(
            "<rect x=\"{LEFT}\" y=\"{HEAD}\" width=\"{width}\" height=\"{inner}\" fill=\"none\" \
             stroke=\"#888\"/>"
        );
        svg + &dots(without, THINNED, "#aaa", 1.5) + &dots(added, 1, "#c82828", 4.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_cloud_are_read_whatever_follows_each() {
        let mut ply = b"ply\nelement vertex 2\nproperty float x\nend_header\n".to_vec();
        for point in [[1.0_f32, 2.0, 3.0, 9.0], [4.0, 5.0, 6.0, 9.0]] {
            point.iter().for_each(|part| ply.extend(part.to_le_bytes()));
        }
        assert_eq!(points(&ply), Some(vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]));
        assert_eq!(points(b"ply\n"), None);
    }

    #[test]
    fn points_are_added_where_none_was_within_30_cm() {
        let without = [[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]];
        let with = vec![[0.1, 0.2, 0.1], [5.0, 0.31, 0.0], [9.0, 0.0, 0.0]];
        assert_eq!(added(&without, with), [[5.0, 0.31, 0.0], [9.0, 0.0, 0.0]]);
    }
}
