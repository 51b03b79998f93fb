//! A camera as it is asked for, before it is known where the cloth lies.

use glam::DVec3;
use rayon::prelude::*;

use super::{
    Fabric, Object,
    camera::{Camera, Lens, Projection},
    defaults,
    motion::{self, Aim, CameraMotion},
};

/// A camera in the scene's own place, and how it finds the cloth. By default it frames the cloth from +z.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraSetup {
    /// Its directions and projection, and where it stands if it does not frame the cloth.
    pub camera: Camera,
    /// The share of the picture left free on each side, if the camera moves to where it sees all of the cloth.
    pub margin: Option<f64>,
    /// The lens; `None` for a pinhole.
    pub lens: Option<LensSetup>,
    /// What it looks at, if it is told: keys of `motion` move these places.
    pub aim: Option<Aim>,
    /// Which way is up: the axis of a turntable.
    pub up: DVec3,
    /// How it moves.
    pub motion: CameraMotion,
    /// Whether it goes to the face of flat cloth that it would see from the edge.
    pub faces_cloth: bool,
}

/// A lens before it is known where the cloth is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensSetup {
    /// Radius of the opening, millimetres.
    pub radius: f64,
    /// What is sharp.
    pub focus: Focus,
}

/// What is sharp, in the scene's own place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Focus {
    /// The middle of the cloth.
    Cloth,
    /// What is so far away along the view, millimetres.
    Distance(f64),
    /// The plane through a point, millimetres.
    Point(DVec3),
}

impl Default for CameraSetup {
    fn default() -> Self {
        let projection = Projection::Perspective(defaults::FIELD_OF_VIEW.to_radians());
        Self::framing(DVec3::from(defaults::VIEW_FROM), DVec3::from(defaults::UP), projection)
            .expect("the default view is not along the default up")
    }
}

impl CameraSetup {
    /// One that sees all of the cloth from a direction; `None` if that is zero or along `up`. The height of an
    /// orthographic view does not matter.
    pub fn framing(direction: DVec3, up: DVec3, projection: Projection) -> Option<Self> {
        let camera = Camera::looking_at(direction, DVec3::ZERO, up, projection)?;
        let margin = Some(defaults::MARGIN);
        let motion = CameraMotion::default();
        Some(Self { camera, margin, lens: None, aim: None, up, motion, faces_cloth: false })
    }

    /// One that stands and looks where it is told; `None` if these places fall together or the view is along `up`.
    pub fn aimed(aim: Aim, projection: Projection) -> Option<Self> {
        let camera = Camera::looking_at(aim.position, aim.target, aim.up, projection)?;
        let motion = CameraMotion::default();
        Some(Self { camera, margin: None, lens: None, aim: Some(aim), up: aim.up, motion, faces_cloth: false })
    }

    /// The camera at a frame for cloth that lies about `middle`. Without any cloth it frames `objects`.
    pub(super) fn place(
        &self,
        fabrics: &[Fabric],
        objects: &[Object],
        middle: DVec3,
        aspect: f64,
        frame: f64,
    ) -> Views {
        let frame_all = |margin, clouds: &[Cloud<'_>]| -> Camera {
            let camera = match self.faces_cloth {
                true => self.camera.facing(clouds.iter().flat_map(Cloud::points).map(|(p, _)| p)),
                false => self.camera,
            };
            if !self.motion.turns() {
                return camera.framing(clouds.par_iter().flat_map_iter(Cloud::points), aspect, margin);
            }
            // From every side, so that the camera keeps its distance.
            let outline = motion::revolved(clouds.iter().flat_map(Cloud::points), self.up);
            camera.framing(outline.par_iter().map(|p| (p, 0.0)), aspect, margin)
        };
        let still = match self.margin {
            None => Camera { position: self.camera.position - middle, ..self.camera },
            Some(margin) if fabrics.iter().all(|f| f.curves.is_empty()) => {
                let meshes: Vec<_> = objects.iter().map(|o| Cloud { points: &o.mesh.points, radii: &[] }).collect();
                frame_all(margin, &meshes)
            }
            Some(margin) => {
                let curves = fabrics.iter().flat_map(|f| &f.curves);
                let curves: Vec<_> = curves.map(|(c, radii)| Cloud { points: &c.points, radii }).collect();
                frame_all(margin, &curves)
            }
        };
        let (mut camera, mut path) = self.motion.poses(&still, self.aim.as_ref(), middle, self.up, frame);
        let flow = [frame, frame + 1.0].map(|time| self.motion.at(&still, self.aim.as_ref(), middle, self.up, time));
        if let Some(lens) = &self.lens {
            for camera in std::iter::once(&mut camera).chain(&mut path) {
                camera.lens = Some(lens.of(camera, middle));
            }
        }
        Views { camera, path, flow }
    }
}

/// A camera as a scene has it.
pub(super) struct Views {
    /// In the middle of the shutter's time.
    pub(super) camera: Camera,
    /// While the shutter is open; empty if it stands still.
    pub(super) path: Vec<Camera>,
    /// At the frame's own time and one frame later.
    pub(super) flow: [Camera; 2],
}

/// Points that a camera shall frame, and their radii unless they have none.
struct Cloud<'a> {
    points: &'a [DVec3],
    radii: &'a [f64],
}

impl<'a> Cloud<'a> {
    fn points(&self) -> impl Iterator<Item = (&'a DVec3, f64)> + Clone + use<'a> {
        let radii = self.radii;
        let radius = move |i: usize| radii.get(i).copied().unwrap_or(0.0);
        self.points.iter().enumerate().map(move |(i, p)| (p, radius(i)))
    }
}

impl LensSetup {
    fn of(&self, camera: &Camera, middle: DVec3) -> Lens {
        let along_view = |point: DVec3| (camera.position - point).dot(camera.back);
        let focus = match self.focus {
            Focus::Cloth => along_view(DVec3::ZERO),
            Focus::Distance(distance) => distance,
            Focus::Point(point) => along_view(point - middle),
        };
        // What lies behind the camera can not be sharp.
        Lens { radius: self.radius, focus: focus.max(1e-6) }
    }
}
