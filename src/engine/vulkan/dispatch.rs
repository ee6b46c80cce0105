//! A stage on its way into a command buffer.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use super::buffer::{Buffer, Memory};
use super::pipeline::Pipeline;
use super::recorder::Recorder;
use super::stage::{Access, Stage};

impl Recorder {
    /// Starts the record of one stage: `recorder.stage(&fade, FadeStage { source, target }).push(&push).linear(groups)`.
    pub fn stage<'r, 'a, S: Stage<'a>>(&'r mut self, pipeline: &'a Pipeline, stage: S) -> StageRecord<'r, 'a, S::Push> {
        let shader = pipeline.shader;
        // A mismatch here is a mistake in this crate that no input can cause.
        assert_eq!(shader.buffers, S::SHADER.buffers, "`{}` bound as `{}`", shader.name, S::SHADER.name);
        StageRecord { recorder: self, pipeline, buffers: stage.in_order(), push: None }
    }
}

/// A stage being recorded; nothing happens before one of its last three methods is called.
pub struct StageRecord<'r, 'a, P> {
    recorder: &'r mut Recorder,
    pipeline: &'a Pipeline,
    buffers: Vec<&'a Buffer>,
    push: Option<P>,
}

enum Size<'a> {
    Groups([u32; 3]),
    Indirect(&'a Buffer, u64),
}

impl<'a, P: Pod> StageRecord<'_, 'a, P> {
    /// The push constants.
    pub fn push(mut self, constants: &P) -> Self {
        self.push = Some(*constants);
        self
    }

    /// Dispatches so many workgroups.
    pub fn groups(self, groups: [u32; 3]) {
        self.dispatch(&Size::Groups(groups));
    }

    /// Dispatches at least `count` workgroups, laid out in x and y so that no limit is met; the shader finds its own
    /// number with `group_index()` and returns where that is `count` or more.
    pub fn linear(self, count: u32) {
        let [x, y] = linear_groups(count);
        self.groups([x, y, 1]);
    }

    /// Dispatches as many workgroups as the three `u32` at byte `offset` of `buffer` give.
    pub fn indirect(self, buffer: &'a Buffer, offset: u64) {
        self.dispatch(&Size::Indirect(buffer, offset));
    }

    fn dispatch(self, size: &Size<'a>) {
        let Self { recorder, pipeline, buffers, push } = self;
        let (shader, compiled) = (pipeline.shader, pipeline.compiled);
        let push = push.as_ref().map_or(&[][..], bytemuck::bytes_of);
        // A mismatch here is a mistake in this crate that no input can cause.
        assert_eq!(push.len(), shader.push_size as usize, "push constants of `{}`", shader.name);
        let indirect = match size {
            Size::Groups(groups) if groups.contains(&0) => return,
            Size::Groups(groups) => {
                let most = recorder.context.physical().groups;
                if groups.iter().zip(&most).any(|(groups, most)| groups > most) {
                    recorder.refuse(format!("{groups:?} workgroups of `{}` are more than {most:?}", shader.name));
                }
                None
            }
            Size::Indirect(buffer, offset) => {
                let inside = offset.is_multiple_of(4) && offset.checked_add(12).is_some_and(|end| end <= buffer.size());
                if !inside || !buffer.memory.usage.contains(vk::BufferUsageFlags::INDIRECT_BUFFER) {
                    let name = shader.name;
                    recorder.refuse(format!("{:?} has no size of `{name}` at byte {offset}", buffer.name()));
                }
                Some(*buffer)
            }
        };
        if !Arc::ptr_eq(&pipeline.context, &recorder.context) {
            recorder.refuse(format!("the pipeline of `{}` is of another context", shader.name));
        }
        if !recorder.keep(buffers.iter().copied().chain(indirect)) {
            return;
        }
        let of = |access| {
            let bound = buffers.iter().zip(shader.buffers).filter(move |(_, (_, a))| *a == access);
            bound.map(|(buffer, _)| buffer.handle()).collect::<Vec<_>>()
        };
        let mut read = of(Access::Read);
        read.extend(indirect.map(Buffer::handle));
        recorder.touch(&read, &of(Access::Write));
        let infos: Vec<_> = buffers
            .iter()
            .map(|buffer| {
                let Memory { raw, offset, .. } = *buffer.memory;
                [vk::DescriptorBufferInfo::default().buffer(raw).offset(offset).range(buffer.size())]
            })
            .collect();
        let writes: Vec<_> = infos
            .iter()
            .enumerate()
            .map(|(slot, info)| {
                vk::WriteDescriptorSet::default()
                    .dst_binding(slot as u32)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .buffer_info(info)
            })
            .collect();
        recorder.begin_step(shader.name);
        // SAFETY: the command buffer is recording; pipeline and buffers are of this device and kept until this has run; as many buffers are
        // bound as the stage declares, and the size is within what the device takes.
        unsafe {
            let context = &recorder.context;
            let (device, raw) = (&context.device, recorder.raw);
            if let Some(labels) = &context.debug_utils {
                let label = context.prefixed(shader.label);
                labels.cmd_begin_debug_utils_label(raw, &vk::DebugUtilsLabelEXT::default().label_name(&label));
            }
            if let Some(checkpoints) = &context.checkpoints {
                checkpoints.cmd_set_checkpoint(raw, shader.label.as_ptr().cast());
            }
            device.cmd_bind_pipeline(raw, vk::PipelineBindPoint::COMPUTE, compiled.raw);
            if !writes.is_empty() {
                context.push_descriptor.cmd_push_descriptor_set(
                    raw,
                    vk::PipelineBindPoint::COMPUTE,
                    compiled.layout,
                    0,
                    &writes,
                );
            }
            if !push.is_empty() {
                let flags = vk::ShaderStageFlags::COMPUTE;
                device.cmd_push_constants(raw, compiled.layout, flags, 0, push);
            }
            match size {
                Size::Groups([x, y, z]) => device.cmd_dispatch(raw, *x, *y, *z),
                Size::Indirect(buffer, offset) => {
                    device.cmd_dispatch_indirect(raw, buffer.handle(), buffer.memory.offset + offset);
                }
            }
            if let Some(labels) = &context.debug_utils {
                labels.cmd_end_debug_utils_label(raw);
            }
        }
        recorder.stop_clock();
        if recorder.context.debug_sync && recorder.owned() && recorder.clock.is_none() {
            let ran = recorder.run_now(shader.name);
            recorder.failure = ran.err().or(recorder.failure.take());
        }
    }
}

/// Workgroups in x and y for a linear dispatch of `count`: y is 1 up to the 65,535 groups that every device takes.
pub fn linear_groups(count: u32) -> [u32; 2] {
    if count <= 65_535 { [count, 1] } else { [32_768, count.div_ceil(32_768)] }
}
