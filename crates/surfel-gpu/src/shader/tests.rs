//! Every kernel is valid and short, and the records have the same fields at the same offsets on both sides.

use super::*;
use crate::records::{
    FrameRecord, HitRecord, InstanceRecord, LightRecord, MaterialRecord, Path, SearchState,
    ShadingPointRecord, Task, TextureRecord, Visit,
};
use std::mem::{offset_of, size_of};
use surfel_core::math::Ray;
use wgpu::naga::front::wgsl;
use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};
use wgpu::naga::{Module, TypeInner};

fn parse(kernel: Kernel, page_shift: Option<u32>) -> Module {
    let source = kernel.source(page_shift);
    wgsl::parse_str(&source)
        .unwrap_or_else(|error| panic!("{kernel:?}: {}", error.emit_to_string(&source)))
}

#[test]
fn every_kernel_is_valid() {
    for (kernel, page_shift) in
        Kernel::all().into_iter().flat_map(|kernel| [(kernel, None), (kernel, Some(23))])
    {
        let module = parse(kernel, page_shift);
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        if let Err(error) = validator.validate(&module) {
            panic!("{kernel:?}: {}", error.emit_to_string(&kernel.source(page_shift)));
        }
        let entries: Vec<&str> =
            module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
        assert!(entries.contains(&kernel.entry_point()), "{kernel:?} {entries:?}");
    }
}

type Layout = (u32, Vec<(String, u32)>);

fn wgsl_layout(module: &Module, name: &str) -> Layout {
    let (_, ty) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).unwrap();
    let TypeInner::Struct { members, span } = &ty.inner else { panic!("{name} is no struct") };
    let members = members.iter().map(|member| (member.name.clone().unwrap(), member.offset));
    (*span, members.collect())
}

macro_rules! rust_layout {
    ($record:ident { $($field:ident),* $(,)? }) => {{
        let fields: Vec<(String, u32)> = vec![
            $((stringify!($field).to_owned(), offset_of!($record, $field) as u32)),*
        ];
        (stringify!($record), (size_of::<$record>() as u32, fields))
    }};
}

#[test]
fn records_have_equal_layouts() {
    let layouts: Vec<(&str, Layout)> = vec![
        rust_layout!(Ray { origin, t_min, direction, t_max }),
        rust_layout!(FrameRecord {
            position,
            lens,
            forward,
            pixel_width,
            right,
            pixel_height,
            up,
            n_planes,
            center,
            seed,
            n_columns,
            first_pixel,
            n_rays,
            sample_idx,
            n_samples,
            is_centered,
            is_first,
            capacity,
            background_top,
            background,
            background_bottom,
            height,
            background_up,
            n_lights,
            max_depth,
            n_light_samples,
            pixel_at_origin,
            pixel_per_distance,
            first_row,
            n_rows,
            first_column,
            reserved,
            planes
        }),
        rust_layout!(Visit {
            object_from_world,
            world_from_normal,
            world_from_object,
            instance,
            align,
            is_identity,
            surface,
            max_scale,
            max_blend_distance,
            edge_retest_factor,
            has_edge_test,
            has_front_sides,
            blends_colors,
            block_vectors,
            attributes,
            gathers_to_nearest,
            has_outward_normals,
            min_discs,
            is_mirrored,
            lower,
            radius_factor,
            upper,
            reserved_a,
            root_node,
            first_vector,
            n_harmonics,
            reserved_b
        }),
        rust_layout!(Task {
            light,
            sample_idx,
            max_samples,
            queue,
            ray_kind,
            first_visit,
            n_visits,
            round
        }),
        rust_layout!(LightRecord {
            direction,
            kind,
            color,
            cos_max,
            ground,
            ao_distance,
            position,
            radius,
            inner_cos,
            outer_cos,
            range,
            lamp,
            size,
            first_word,
            strength
        }),
        rust_layout!(TextureRecord {
            first_word,
            width,
            height,
            flags,
            offset,
            scale,
            cos,
            sin,
            reserved_a,
            reserved_b
        }),
        rust_layout!(MaterialRecord {
            base_color,
            ignores_vertex_colors,
            emissive,
            emissive_strength,
            attenuation_color,
            attenuation_distance,
            is_unlit,
            alpha,
            alpha_mode,
            alpha_cutoff,
            metallic,
            roughness,
            ior,
            transmission,
            is_thin,
            normal_scale,
            reserved_a,
            reserved_b,
            textures
        }),
        rust_layout!(InstanceRecord {
            lower,
            material,
            upper,
            max_scale,
            has_outward_normals,
            attributes,
            first_support_color,
            support_low,
            support_high,
            spawn_factor,
            reserved_a,
            reserved_b
        }),
        rust_layout!(HitRecord {
            normal,
            distance,
            color,
            radius,
            geometric_normal,
            alpha,
            slot,
            instance,
            is_backface,
            surface,
            support_count,
            support_distance,
            barycentrics,
            uvs,
            tangent,
            gaussian_radiance,
            gaussian_transmittance,
            gaussian_distance,
            reserved_a,
            reserved_b,
            reserved_c
        }),
        rust_layout!(Path {
            ray,
            weight,
            pixel,
            transmittance,
            origin_offset,
            media,
            key,
            index,
            state
        }),
        rust_layout!(SearchState {
            slot,
            distance,
            passed_slot,
            passed_distance,
            undecided,
            reserved_a,
            reserved_b
        }),
        rust_layout!(ShadingPointRecord {
            position,
            spawn_offset,
            normal,
            spawn_t_min,
            geometric_normal,
            roughness,
            to_viewer,
            pixel,
            diffuse,
            index,
            glossy,
            n_light_samples,
            media,
            key,
            light_steepness,
            reserved
        }),
    ];
    let module = parse(Kernel::Generate, None);
    for (name, layout) in layouts {
        assert_eq!(wgsl_layout(&module, name), layout, "{name}");
    }
}

#[test]
fn files_of_kernels_are_short() {
    for kernel in Kernel::all() {
        for part in kernel.parts().into_iter().flatten() {
            assert!(part.lines().count() < 300, "{kernel:?}");
        }
    }
}

#[test]
fn no_kernel_takes_the_sine_of_its_device() {
    // Vulkan allows errors of 2^-11 there.
    for kernel in Kernel::all() {
        for part in kernel.parts().into_iter().flatten() {
            for (i, _) in part.match_indices("sin(").chain(part.match_indices("cos(")) {
                let before = part[..i].chars().next_back();
                let is_end = before.is_some_and(|c| c.is_ascii_alphanumeric() || c == '_');
                let line = part[i..].lines().next();
                assert!(is_end, "{kernel:?}: {line:?}");
            }
        }
    }
}
