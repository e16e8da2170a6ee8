//! The page of a scene: a 3D view with its viewpoints and pairs.

use echoloop_sim::picture::{PITCH_RAD, Picture, YAW_RAD, colour, view_box};
use echoloop_sim::scene::{Material, Scene};
use serde_json::{Value, json};

use super::error::ReportError;
use super::format::{base64, escape, grouped, significant};
use super::packed::{MOST_TRIANGLES, Packed};
use super::page::{document_with, facts};
use super::picture::picture_png;

const STYLE: &str = include_str!("scene.css");
const CAMERA: &str = include_str!("camera.js");
const VIEWER: &str = include_str!("scene.js");

/// Unit vector to the sun, high in the south-west.
const SUN: [f64; 3] = [-0.48, -0.36, 0.80];

/// A scene to show.
#[derive(Clone, Debug)]
pub struct ScenePage<'a> {
    /// Heading of the page.
    pub title: String,
    /// One line under the heading.
    pub subtitle: String,
    /// Names and values above the view.
    pub facts: Vec<(String, String)>,
    /// The scene.
    pub scene: &'a Scene,
    /// Pairs of viewpoints.
    pub pairs: Vec<ShownPair>,
    /// Picture in place of the view where a browser cannot draw it.
    pub still: &'a Picture,
    /// Remarks, a sentence each.
    pub notes: Vec<String>,
}

/// A pair of viewpoints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShownPair {
    /// Name.
    pub name: String,
    /// Short description, for the list.
    pub brief: String,
    /// Full description, shown when the pair is selected.
    pub told: String,
    /// True for a held-out pair, false for a training pair.
    pub is_held_out: bool,
    /// Positions of the sensors, metres.
    pub at_m: [[f64; 3]; 2],
    /// Unit vectors of their directions of view.
    pub ahead: [[f64; 3]; 2],
}

impl ScenePage<'_> {
    /// The page, complete. It refers to nothing outside itself, and the same data gives the same
    /// bytes. It holds the four million largest triangles at most, and says so.
    ///
    /// # Errors
    ///
    /// [`ReportError::Drawing`] when the still picture has no pixels.
    pub fn to_html(&self) -> Result<String, ReportError> {
        let packed = Packed::new(&self.scene.mesh, MOST_TRIANGLES);
        let still = picture_png(self.still, &[]).map_err(ReportError::Drawing)?;
        let header = format!(
            "<header><p class=\"eyebrow\">Echoloop</p><h1>{}</h1><p class=\"subtitle\">{}</p>\
             {}</header>\n",
            escape(&self.title),
            escape(&self.subtitle),
            facts(&self.facts)
        );
        let sections = [header, self.section(&packed, &still), self.notes(&packed)].concat();
        let script = [CAMERA, VIEWER].concat();
        Ok(document_with(STYLE, "wide", &self.title, &sections, &script))
    }

    fn section(&self, packed: &Packed, still: &[u8]) -> String {
        format!(
            "<section id=\"scene\"><h2>In three dimensions</h2>\
             <p class=\"lead\">A dot is a place where the sensor stands, a short line the way it \
             looks, and the line between two dots a pair's baseline. What is behind something \
             shows faintly.</p><div class=\"scene\"><div>{}{}{}{}</div><aside>{}{}</aside></div>\
             <script type=\"application/json\" id=\"scene-data\">{}</script>\
             <script type=\"text/plain\" id=\"geometry\">{}</script></section>\n",
            controls(),
            stage(&self.title, still),
            selected_pair(),
            HINT,
            self.list(),
            self.legend(packed),
            self.data(packed),
            base64(&packed.bytes)
        )
    }

    fn list(&self) -> String {
        let entry = |(index, pair): (usize, &ShownPair)| {
            format!(
                "<li><button type=\"button\" data-pair=\"{index}\" aria-pressed=\"false\">\
                 <i class=\"swatch {}\"></i>{} <span>{}</span></button></li>",
                if pair.is_held_out { "source" } else { "target" },
                escape(&pair.name),
                escape(&pair.brief)
            )
        };
        let entries: String = self.pairs.iter().enumerate().map(entry).collect();
        match self.pairs.is_empty() {
            true => "<h3>Pairs</h3><p>There are none.</p>".to_owned(),
            false => format!(
                "<h3 id=\"pairs-head\">Pairs</h3><ul class=\"pairs\" \
                 aria-labelledby=\"pairs-head\">{entries}</ul>"
            ),
        }
    }

    fn material(&self, index: u8) -> Option<&Material> {
        self.scene.materials.get(usize::from(index))
    }

    fn legend(&self, packed: &Packed) -> String {
        let entry = |(index, &(material, count)): (usize, &(u8, usize))| {
            let Some(material) = self.material(material) else { return String::new() };
            let [r, g, b] = colour(material.name);
            format!(
                "<li><label title=\"{} triangles\"><input type=\"checkbox\" \
                 id=\"material-{index}\" checked><i id=\"swatch-{index}\" \
                 style=\"background:#{r:02x}{g:02x}{b:02x}\"></i>{} <span>{}</span></label></li>",
                grouped(count),
                escape(material.name),
                significant(f64::from(material.reflectance_905nm))
            )
        };
        let entries: String = packed.groups.iter().enumerate().map(entry).collect();
        format!(
            "<h3 id=\"materials-head\">Materials</h3><p>Diffuse reflectance at 905 nm; above 1 a \
             retro-reflector's.</p><ul class=\"legend-list\" aria-labelledby=\"materials-head\">\
             {entries}</ul>"
        )
    }

    /// Data of the script besides the geometry. `<` is escaped, so that no text ends the element.
    fn data(&self, packed: &Packed) -> String {
        let (low, high) = view_box(self.scene);
        let both = |k: usize| (f64::from(low[k]), f64::from(high[k]));
        let middle = [0, 1, 2].map(|k| f64::midpoint(both(k).0, both(k).1));
        let half = [0, 1, 2].map(|k| (0.5 * (both(k).1 - both(k).0)).max(0.5));
        let group = |&(material, triangles): &(u8, usize)| {
            let known = self.material(material);
            json!({
                "triangles": triangles,
                "colour": known.map_or([0; 3], |m| colour(m.name)),
                "reflectance": known.map_or(0.0, |m| m.reflectance_905nm),
            })
        };
        let document = json!({
            "vertices": packed.vertices,
            "origin": rounded([0, 1, 2].map(|k| packed.low[k] - middle[k]), 5),
            "extent": rounded(packed.extent, 5),
            "middle": rounded(middle, 5), "half": rounded(half, 3), "sun": SUN,
            "start": { "yaw": YAW_RAD, "pitch": PITCH_RAD },
            "groups": packed.groups.iter().map(group).collect::<Vec<_>>(),
            "pairs": self.pairs.iter().map(of_pair).collect::<Vec<_>>(),
        });
        document.to_string().replace('<', "\\u003c")
    }

    fn notes(&self, packed: &Packed) -> String {
        let step_mm = packed.step_m().map(|step| significant(1000.0 * step));
        let drawn: usize = packed.groups.iter().map(|(_, count)| count).sum();
        let mut notes = self.notes.clone();
        notes.push(format!(
            "{} triangles are drawn, their corners in steps of {} × {} × {} mm (16 bits along each \
             axis). A scan meets the exact ones.",
            grouped(drawn),
            step_mm[0],
            step_mm[1],
            step_mm[2]
        ));
        if packed.collapsed > 0 {
            let count = grouped(packed.collapsed);
            notes.push(format!("{count} triangles are too small for these steps: left out here."));
        }
        if packed.smallest > 0 {
            let (count, most) = (grouped(packed.smallest), grouped(MOST_TRIANGLES));
            notes.push(format!(
                "A page has {most} triangles at most: the {count} smallest are left out here."
            ));
        }
        let items: String = notes.iter().map(|note| format!("<li>{}</li>", escape(note))).collect();
        format!("<section id=\"notes\"><h2>Notes</h2><ul class=\"notes\">{items}</ul></section>\n")
    }
}

fn of_pair(pair: &ShownPair) -> Value {
    json!({
        "set": u8::from(pair.is_held_out), "name": pair.name, "told": pair.told,
        "at": pair.at_m.map(|at| rounded(at, 3)), "ahead": pair.ahead.map(|way| rounded(way, 4)),
    })
}

fn rounded(numbers: [f64; 3], decimals: i32) -> [f64; 3] {
    let scale = 10_f64.powi(decimals);
    numbers.map(|number| (number * scale).round() / scale)
}

fn controls() -> &'static str {
    "<div class=\"controls\" data-live hidden>\
     <label><input type=\"checkbox\" id=\"show-train\" checked><i class=\"swatch \
     target\"></i>training pairs</label>\
     <label><input type=\"checkbox\" id=\"show-held-out\" checked><i class=\"swatch \
     source\"></i>held-out pairs</label>\
     <label>colour by <select id=\"colour-by\"><option value=\"0\">material</option>\
     <option value=\"1\">reflectance</option></select></label>\
     <button type=\"button\" id=\"view-reset\">reset view</button>\
     <button type=\"button\" id=\"view-top\">from above</button></div>"
}

fn stage(title: &str, still: &[u8]) -> String {
    format!(
        "<div class=\"stage\" id=\"stage\"><canvas id=\"view-scene\" tabindex=\"0\" \
         role=\"application\" aria-label=\"{title} in three dimensions\" \
         aria-describedby=\"view-hint\" data-live hidden></canvas>\
         <div class=\"pair-name\" id=\"pair-name\" hidden></div></div>\
         <img class=\"still\" id=\"still\" alt=\"{title} from above and beside\" \
         src=\"data:image/png;base64,{}\">\
         <p class=\"fallback\" id=\"no-view\" hidden>To turn the scene needs WebGL2 and \
         DecompressionStream, which this browser does not offer: this is a still picture.</p>\
         <noscript><p class=\"fallback\">To turn the scene needs JavaScript: this is a still \
         picture.</p></noscript>",
        base64(still),
        title = escape(title)
    )
}

/// Description of the selected pair, with buttons that move the view.
fn selected_pair() -> &'static str {
    "<div class=\"told\" data-live hidden><p id=\"pair-told\" role=\"status\">No pair is \
     selected.</p><span id=\"pair-hands\" hidden>\
     <button type=\"button\" data-stand=\"0\">stand at the first</button> \
     <button type=\"button\" data-stand=\"1\">stand at the second</button> \
     <button type=\"button\" id=\"pair-leave\">leave it</button></span></div>"
}

const HINT: &str = "<p class=\"hint\" id=\"view-hint\" data-live hidden>Drag to orbit, shift-drag \
     or two fingers to pan, pinch to zoom; click the view, then scroll to zoom. Click a dot to \
     select its pair. Keys: arrows orbit, shift and arrows pan, + and − zoom, 0 resets, n and p \
     select the next and the previous pair, Escape none.</p>";
