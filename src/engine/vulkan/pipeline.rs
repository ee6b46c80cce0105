//! A compute pipeline made from a stage.

use std::sync::Arc;

use ash::vk;
use rayon::prelude::*;

use super::context::Context;
use super::reuse::Compiled;
use super::stage::{Constants, Shader, Stage};
use crate::Result;
use crate::engine::parallel::lock;

/// [`Pipeline::new`] of a stage.
type Compile<C> = fn(&Arc<Context>, &C) -> Result<Pipeline>;

/// A stage, compiled for a device; the context keeps it, so that the same stage with the same constants is compiled once.
pub struct Pipeline {
    pub(super) compiled: Compiled,
    pub(super) shader: &'static Shader,
    pub(super) context: Arc<Context>,
}

impl Pipeline {
    /// Compiles the shader of a stage for a device: `Pipeline::new::<FadeStage>(&context, &constants)`.
    ///
    /// # Errors
    /// Where the driver refuses.
    pub fn new<S: Stage<'static>>(context: &Arc<Context>, constants: &S::Constants) -> Result<Self> {
        let shader = S::SHADER;
        let key = (std::ptr::from_ref(shader).addr(), constants.words());
        let pipelines = &context.reusable.pipelines;
        let found = lock(pipelines).get(&key).copied();
        let compiled = match found {
            Some(compiled) => compiled,
            None => {
                let compiled = compile(context, shader, &key.1)?;
                let kept = *lock(pipelines).entry(key).or_insert(compiled);
                if kept.raw != compiled.raw {
                    // SAFETY: another thread has compiled the same one meanwhile; nobody has seen this.
                    unsafe { compiled.destroy(&context.device) };
                }
                kept
            }
        };
        Ok(Self { compiled, shader, context: context.clone() })
    }

    /// Compiles several stages with the same constants side by side, as a driver takes its time over each:
    /// `Pipeline::several(&context, &constants, [Pipeline::new::<FadeStage>, Pipeline::new::<CopyStage>])`.
    ///
    /// # Errors
    /// Where the driver refuses one of them.
    pub fn several<C: Constants + Sync, const N: usize>(
        context: &Arc<Context>,
        constants: &C,
        stages: [Compile<C>; N],
    ) -> Result<[Self; N]> {
        let compile = |stage: Compile<C>| stage(context, constants);
        let mut made = stages.into_par_iter().map(compile).collect::<Result<Vec<_>>>()?.into_iter();
        // As many come out as went in.
        Ok(std::array::from_fn(|_| made.next().expect("a pipeline for every stage")))
    }

    /// Runs `compile` on another thread beside `here`, which may fill buffers: a host's lock may be of threads.
    pub fn beside<A: Send, B>(compile: impl FnOnce() -> A + Send, here: impl FnOnce() -> B) -> (A, B) {
        let mut compiled = None;
        let done = rayon::in_place_scope(|scope| {
            scope.spawn(|_| compiled = Some(compile()));
            here()
        });
        // The scope ends when all that was spawned has ended.
        (compiled.expect("what was compiled"), done)
    }
}

fn compile(context: &Context, shader: &Shader, constants: &[u32]) -> Result<Compiled> {
    let mut made = Compiled::default();
    if let Err(error) = fill(&mut made, context, shader, constants) {
        // SAFETY: nothing has been recorded with what was made before the failure.
        unsafe { made.destroy(&context.device) };
        return Err(error);
    }
    context.name(made.raw, shader.label);
    Ok(made)
}

/// Makes one part after the other.
fn fill(made: &mut Compiled, context: &Context, shader: &Shader, constants: &[u32]) -> Result<()> {
    let failure = |what| move |code| context.failure(what, code);
    let bindings: Vec<_> = (0..shader.buffers.len() as u32)
        .map(|slot| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(slot)
                .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        })
        .collect();
    let set_info = vk::DescriptorSetLayoutCreateInfo::default()
        .flags(vk::DescriptorSetLayoutCreateFlags::PUSH_DESCRIPTOR_KHR)
        .bindings(&bindings);
    // SAFETY: all create infos are valid for the device and outlive the calls.
    unsafe {
        let device = &context.device;
        made.set_layout =
            device.create_descriptor_set_layout(&set_info, None).map_err(failure("vkCreateDescriptorSetLayout"))?;
        let sets = [made.set_layout];
        let push = [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(shader.push_size)];
        let mut layout_info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
        if shader.push_size > 0 {
            layout_info = layout_info.push_constant_ranges(&push);
        }
        made.layout = device.create_pipeline_layout(&layout_info, None).map_err(failure("vkCreatePipelineLayout"))?;
        let code: Vec<u32> = bytemuck::pod_collect_to_vec(shader.code);
        let module_info = vk::ShaderModuleCreateInfo::default().code(&code);
        made.module = device.create_shader_module(&module_info, None).map_err(failure("vkCreateShaderModule"))?;
        let entry = |&(number, place): &(u32, usize)| {
            vk::SpecializationMapEntry::default().constant_id(number).offset(4 * place as u32).size(4)
        };
        let entries: Vec<_> = shader.constants.iter().map(entry).collect();
        let special = vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(constants));
        let asked = context.physical().asked_width.filter(|_| shader.subgroups);
        let mut width = vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo::default()
            .required_subgroup_size(asked.unwrap_or_default());
        let mut stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(made.module)
            .name(c"main")
            .specialization_info(&special);
        if asked.is_some() {
            let full = vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS;
            stage = stage.flags(full).push_next(&mut width);
        }
        let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(made.layout)];
        let all = device.create_compute_pipelines(context.pipeline_cache, &info, None);
        made.raw = all.map_err(|(_, code)| context.failure("vkCreateComputePipelines", code))?[0];
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::primitives::{Operation, Reduce};
    use crate::engine::vulkan::ContextOptions;

    /// If this failed, each tracer, planner and trainer of a context would compile its shaders anew, half a second at a time on software; or
    /// constants or contexts would be mixed up.
    #[test]
    fn a_stage_is_compiled_once_for_each_context_and_constants() -> Result<()> {
        let options = ContextOptions { validation: true, ..ContextOptions::default() };
        let [context, other] = [Context::new(&options)?, Context::new(&options)?];
        let kept = |context: &Context| lock(&context.reusable.pipelines).len();
        let sum = Reduce::new(&context, Operation::SumF32, 1000)?;
        let before: Vec<_> = lock(&context.reusable.pipelines).values().map(|compiled| compiled.raw).collect();
        (0..8).into_par_iter().try_for_each(|_| Reduce::new(&context, Operation::SumF32, 2000).map(drop))?;
        // Those of several threads at once too, of which all but one are destroyed.
        (0..8).into_par_iter().try_for_each(|_| Reduce::new(&context, Operation::MaxF32, 1000).map(drop))?;
        drop(sum);
        assert_eq!((before.len(), kept(&context), kept(&other)), (1, 2, 0));
        assert!(lock(&context.reusable.pipelines).values().any(|compiled| compiled.raw == before[0]));
        // What a context keeps goes with it, which the validation layers watch.
        drop(Reduce::new(&other, Operation::SumF32, 1000)?);
        drop(other);
        assert_eq!(context.messages(), [""; 0]);
        Ok(())
    }
}
