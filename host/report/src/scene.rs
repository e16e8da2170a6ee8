//! The page of a scene: a 3D view with its viewpoints and pairs.

use echoloop_closed_loop::dataset::survey::SurveyedPair;
use echoloop_sim::picture::{PITCH_RAD, YAW_RAD, colour, view_box};
use echoloop_sim::scene::{Material, Scene};
use echoloop_sim::viewpoint::Split;
use nalgebra::Vector3;
use serde_json::{Value, json};

use super::format::{base64, escape, fixed, grouped, significant};
use super::packed::{MAX_TRIANGLES, Packed};
use super::page::{document_with, facts, header, notes_section, subtitle};
use super::panorama::{Panorama, panels};
use super::picture::picture_png;
use super::survey::{STILL_PX, SceneReport};

const STYLE: &str = include_str!("scene.css");
const CAMERA: &str = include_str!("camera.js");
const VIEWER: &str = include_str!("scene.js");

/// Unit vector to the sun, high in the south-west.
const SUN: [f64; 3] = [-0.48, -0.36, 0.80];

impl SceneReport<'_> {
    /// Self-contained page with a 3D view; the same data gives the same bytes. It holds the four
    /// million largest triangles at most, and says so.
    ///
    /// # Errors
    ///
    /// Errors of [`picture_png`](crate::picture_png).
    pub fn page(&self) -> Result<String, String> {
        let packed = Packed::new(&self.scene().mesh, MAX_TRIANGLES);
        let still = picture_png(&self.still(STILL_PX), &[])?;
        let title = &self.scene().name;
        let below = subtitle("A scene, and the pairs of places from which it is scanned.")
            + &facts(&self.facts());
        let sections = [
            header(title, &below),
            self.section(&packed, &still),
            self.beams(),
            notes_section(&self.notes(&packed)),
        ];
        let script = [CAMERA, VIEWER].concat();
        Ok(document_with(STYLE, "wide", title, &sections.concat(), &script))
    }

    /// Beams of a scan from the first viewpoint and what they meet.
    fn beams(&self) -> String {
        let Some((beams, met)) = self.survey.first_scan(self.config) else { return String::new() };
        let panorama = Panorama::of_points("First viewpoint", &beams, met.into_iter());
        format!(
            "<section id=\"beams\"><h2>Where the beams go</h2>\
             <p class=\"lead\">A scan from the first viewpoint, by the scene's surfaces alone: \
             ahead in the middle, behind at both ends.</p>{}</section>\n",
            panels(&[panorama], "beams meet a surface")
        )
    }

    fn scene(&self) -> &Scene {
        &self.survey.place.scene
    }

    fn section(&self, packed: &Packed, still: &[u8]) -> String {
        format!(
            "<section id=\"scene\"><h2>In three dimensions</h2>\
             <p class=\"lead\">A dot is a place where the sensor stands, a short line the way it \
             looks, and the line between two dots a pair's baseline. What is behind something \
             shows faintly.</p><div class=\"scene\"><div>{CONTROLS}{}{SELECTED_PAIR}{HINT}</div>\
             <aside>{}{}</aside></div>\
             <script type=\"application/json\" id=\"scene-data\">{}</script>\
             <script type=\"text/plain\" id=\"geometry\">{}</script></section>\n",
            stage(&self.scene().name, still),
            self.list(),
            self.legend(packed),
            self.data(packed),
            base64(&packed.bytes)
        )
    }

    fn list(&self) -> String {
        let entry = |(index, pair): (usize, &SurveyedPair)| {
            let swatch = if pair.split == Split::Test { "source" } else { "target" };
            format!(
                "<li><button type=\"button\" data-pair=\"{index}\" aria-pressed=\"false\">\
                 <i class=\"swatch {swatch}\"></i>{} <span>{} m, {}°</span></button></li>",
                name_of(pair),
                fixed(pair.baseline_m(), 2),
                fixed(pair.turn_deg(), 1)
            )
        };
        let entries: String = self.survey.pairs.iter().enumerate().map(entry).collect();
        match self.survey.pairs.is_empty() {
            true => "<h3>Pairs</h3><p>There are none.</p>".to_owned(),
            false => format!(
                "<h3 id=\"pairs-head\">Pairs</h3><ul class=\"pairs\" \
                 aria-labelledby=\"pairs-head\">{entries}</ul>"
            ),
        }
    }

    /// Place, direction and description of a pair, for the script.
    fn of_pair(&self, pair: &SurveyedPair) -> Value {
        let is_held_out = pair.split == Split::Test;
        let other = set_of(if is_held_out { Split::Train } else { Split::Test });
        let nearest = self.survey.nearest_other_m(pair);
        let nearest = nearest.map_or_else(String::new, |apart_m| {
            format!("; {} m from the nearest {other} viewpoint", fixed(apart_m, 1))
        });
        let [first, second] = pair.viewpoints;
        let description = format!(
            "viewpoints {first} and {second}, {} m apart, turned by {}°, overlap {:.2}{nearest}.",
            fixed(pair.baseline_m(), 2),
            fixed(pair.turn_deg(), 1),
            pair.overlap
        );
        let poses = pair.world_from_sensor.each_ref();
        json!({
            "set": u8::from(is_held_out), "name": name_of(pair), "told": description,
            "at": poses.map(|pose| rounded(pose.translation.vector.into(), 3)),
            "ahead": poses.map(|pose| rounded((pose.rotation * Vector3::x()).into(), 4)),
        })
    }

    fn material(&self, index: u8) -> Option<&Material> {
        self.scene().materials.get(usize::from(index))
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
        let (low, high) = view_box(self.scene());
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
            "pairs": self.survey.pairs.iter().map(|pair| self.of_pair(pair)).collect::<Vec<_>>(),
        });
        document.to_string().replace('<', "\\u003c")
    }

    fn notes(&self, packed: &Packed) -> Vec<String> {
        let step_mm = packed.step_m().map(|step| significant(1000.0 * step));
        let drawn: usize = packed.groups.iter().map(|(_, count)| count).sum();
        let mut notes: Vec<String> = self.survey.missing.iter().map(ToString::to_string).collect();
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
            let (count, most) = (grouped(packed.smallest), grouped(MAX_TRIANGLES));
            notes.push(format!(
                "A page has {most} triangles at most: the {count} smallest are left out here."
            ));
        }
        notes
    }
}

/// Name of a set of pairs.
fn set_of(split: Split) -> &'static str {
    match split {
        Split::Train => "training",
        Split::Test => "held-out",
    }
}

fn name_of(pair: &SurveyedPair) -> String {
    format!("{} pair {}", set_of(pair.split), pair.number)
}

fn rounded(numbers: [f64; 3], decimals: i32) -> [f64; 3] {
    let scale = 10_f64.powi(decimals);
    numbers.map(|number| (number * scale).round() / scale)
}

const CONTROLS: &str = "<div class=\"controls\" data-live hidden>\
     <label><input type=\"checkbox\" id=\"show-train\" checked><i class=\"swatch \
     target\"></i>training pairs</label>\
     <label><input type=\"checkbox\" id=\"show-held-out\" checked><i class=\"swatch \
     source\"></i>held-out pairs</label>\
     <label>colour by <select id=\"colour-by\"><option value=\"0\">material</option>\
     <option value=\"1\">reflectance</option></select></label>\
     <button type=\"button\" id=\"view-reset\">reset view</button>\
     <button type=\"button\" id=\"view-top\">from above</button></div>";

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
const SELECTED_PAIR: &str = "<div class=\"told\" data-live hidden>\
     <p id=\"pair-told\" role=\"status\">No pair is selected.</p><span id=\"pair-hands\" hidden>\
     <button type=\"button\" data-stand=\"0\">stand at the first</button> \
     <button type=\"button\" data-stand=\"1\">stand at the second</button> \
     <button type=\"button\" id=\"pair-leave\">leave it</button></span></div>";

const HINT: &str = "<p class=\"hint\" id=\"view-hint\" data-live hidden>Drag to orbit, shift-drag \
     or two fingers to pan, pinch to zoom; click the view, then scroll to zoom. Click a dot to \
     select its pair. Keys: arrows orbit, shift and arrows pan, + and − zoom, 0 resets, n and p \
     select the next and the previous pair, Escape none.</p>";
