//! The nearest shapes on each ray, all within a radius of each other.

use super::block::BlockHits;
use super::hit::Gather;
use super::traverse::{ROOT, RayStack, RayVisitor, along_ray};
use crate::flat::{FlatPoints, FlatScene};
use crate::math::{Lanes, Ray};
use crate::surface::Disc;
use std::ops::ControlFlow;

#[inline(always)]
pub(super) fn gathers<L: Lanes>(scene: &FlatScene, rays: &[Ray], gathers: &mut [Gather]) {
    let mut stack = RayStack::new();
    for (ray, result) in rays.iter().zip(gathers) {
        *result = gather::<L>(scene, ray, &mut stack);
    }
}

/// Discs only: spheres do not blend.
#[inline(always)]
pub(super) fn gather<L: Lanes>(scene: &FlatScene, ray: &Ray, stack: &mut RayStack) -> Gather {
    let mut gathering = Gathering { ray, gather: Gather::up_to(ray.t_max) };
    along_ray::<L>(&scene.points, ROOT, ray, stack, &mut gathering);
    gathering.gather
}

struct Gathering<'r> {
    ray: &'r Ray,
    gather: Gather,
}

impl RayVisitor for Gathering<'_> {
    const IS_ORDERED: bool = true;

    #[inline(always)]
    fn ray(&self) -> &Ray {
        self.ray
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.gather.reach()
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()> {
        let reach = self.gather.reach();
        let mut hits = BlockHits::<L>::find::<Disc>(points, block_idx, self.ray).up_to(reach);
        while let Some((hit, radius)) = hits.next() {
            self.gather.insert(hit, radius);
        }
        ControlFlow::Continue(())
    }
}
