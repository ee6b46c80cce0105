/* Plans inside a frame loop of 60 Hz, on the one queue that the application draws with.
 *
 * The plan is made on a thread of its own. It takes the application's lock for each submission, no more of them in a frame than the
 * application allows, and has one at a time on the queue, of 4 ms: a frame never waits for more than that. With a number, the application
 * is closed after so many frames, and the plan ends with it.
 *
 *   cargo rustc --release --lib --no-default-features --features capi --crate-type cdylib
 *   cc -Iinclude examples/c/frame_loop.c -Ltarget/release -lcamsplat -lvulkan -lpthread -o frame_loop
 *   LD_LIBRARY_PATH=target/release ./frame_loop [FRAMES]
 */
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <stdatomic.h>
#include <time.h>

#include "host.h"

#define SUBMISSIONS_OF_A_FRAME 2
#define SUBMISSION_MS 4.0
#define FRAME_MS (1000.0 / 60.0)

/* The application's lock of its queue, with an allowance for the planner in each frame. */
typedef struct Gate {
    pthread_mutex_t mutex;
    pthread_cond_t next_frame;
    int left;       /* submissions that the planner may still make in this frame */
    int most;       /* that it made in any frame */
    int submitted;  /* in all */
    bool closed;    /* whether the application ends */
} Gate;

static uint32_t lock(void *user) {
    Gate *gate = user;
    pthread_mutex_lock(&gate->mutex);
    while (gate->left == 0 && !gate->closed) pthread_cond_wait(&gate->next_frame, &gate->mutex);
    if (gate->closed) {
        pthread_mutex_unlock(&gate->mutex);
        return 0; /* the plan ends */
    }
    gate->left -= 1;
    gate->submitted += 1;
    int made = SUBMISSIONS_OF_A_FRAME - gate->left;
    if (made > gate->most) gate->most = made;
    return 1;
}

static void unlock(void *user) {
    Gate *gate = user;
    pthread_mutex_unlock(&gate->mutex);
}

/* What the planning thread is given and leaves. */
typedef struct Job {
    const CamsplatDevice *device;
    CamsplatRequest request;
    CamsplatPlan *plan;
    CamsplatError *error;
    CamsplatResult result;
    atomic_bool done;
} Job;

static void *plan_on_thread(void *user) {
    Job *job = user;
    job->result = camsplat_plan_make(job->device, &job->request, &job->plan, &job->error);
    atomic_store(&job->done, true);
    return NULL;
}

static double now_ms(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec * 1e3 + (double)now.tv_nsec * 1e-6;
}

/* What a frame draws. Here it is nothing: an empty command buffer shows how long a frame waits for the queue. */
typedef struct Frame {
    VkCommandPool pool;
    VkCommandBuffer commands;
    VkFence fence;
} Frame;

static Frame make_frame(const CamsplatHost *host) {
    Frame frame;
    VkCommandPoolCreateInfo pool_info = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
        .queueFamilyIndex = host->queue_family,
    };
    check(vkCreateCommandPool(host->device, &pool_info, NULL, &frame.pool), "vkCreateCommandPool");
    VkCommandBufferAllocateInfo info = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
        .commandPool = frame.pool,
        .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
        .commandBufferCount = 1,
    };
    check(vkAllocateCommandBuffers(host->device, &info, &frame.commands), "vkAllocateCommandBuffers");
    VkCommandBufferBeginInfo begin = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    check(vkBeginCommandBuffer(frame.commands, &begin), "vkBeginCommandBuffer");
    check(vkEndCommandBuffer(frame.commands), "vkEndCommandBuffer");
    VkFenceCreateInfo fence_info = {.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
    check(vkCreateFence(host->device, &fence_info, NULL, &frame.fence), "vkCreateFence");
    return frame;
}

/* Draws a frame and lets the planner submit again; how long it took in milliseconds. */
static double draw(const CamsplatHost *host, const Frame *frame, Gate *gate) {
    double begun = now_ms();
    VkSubmitInfo submit = {
        .sType = VK_STRUCTURE_TYPE_SUBMIT_INFO,
        .commandBufferCount = 1,
        .pCommandBuffers = &frame->commands,
    };
    pthread_mutex_lock(&gate->mutex);
    check(vkQueueSubmit(host->queue, 1, &submit, frame->fence), "vkQueueSubmit");
    gate->left = SUBMISSIONS_OF_A_FRAME;
    pthread_cond_broadcast(&gate->next_frame);
    pthread_mutex_unlock(&gate->mutex);
    check(vkWaitForFences(host->device, 1, &frame->fence, VK_TRUE, UINT64_MAX), "vkWaitForFences");
    check(vkResetFences(host->device, 1, &frame->fence), "vkResetFences");
    return now_ms() - begun;
}

static void sleep_until(double ms) {
    double left = ms - now_ms();
    if (left <= 0) return;
    struct timespec time = {.tv_sec = (time_t)(left / 1e3)};
    time.tv_nsec = (long)((left - 1e3 * (double)time.tv_sec) * 1e6);
    nanosleep(&time, NULL);
}

int main(int count, char **arguments) {
    Gate gate = {.mutex = PTHREAD_MUTEX_INITIALIZER, .next_frame = PTHREAD_COND_INITIALIZER};
    int last = count > 1 ? atoi(arguments[1]) : 0;
    CamsplatHost host = make_host();
    host.lock = lock;
    host.unlock = unlock;
    host.lock_user = &gate;
    host.submission_ms = SUBMISSION_MS;
    CamsplatDevice *device;
    CamsplatError *error;
    if (camsplat_device_adopt(&host, &device, &error) != CAMSPLAT_RESULT_OK) fail(error);

    Frame frame = make_frame(&host);
    Job job = {.device = device, .request = request_around_cube()};
    pthread_t thread;
    if (pthread_create(&thread, NULL, plan_on_thread, &job) != 0) return 1;
    int frames = 0;
    double longest = 0, next = now_ms();
    while (!atomic_load(&job.done) && (last == 0 || frames < last)) {
        double took = draw(&host, &frame, &gate);
        if (took > longest) longest = took;
        frames += 1;
        next += FRAME_MS;
        sleep_until(next);
    }
    pthread_mutex_lock(&gate.mutex);
    gate.closed = true;
    pthread_cond_broadcast(&gate.next_frame);
    pthread_mutex_unlock(&gate.mutex);
    pthread_join(thread, NULL);
    if (job.result == CAMSPLAT_RESULT_INTERRUPTED) {
        fprintf(stderr, "closed: %s\n", camsplat_error_message(job.error));
        camsplat_error_free(job.error);
    } else if (job.result != CAMSPLAT_RESULT_OK) {
        fail(job.error);
    }

    print_cameras(job.plan);
    fprintf(stderr, "%d frames, %d submissions of the planner, %d in a frame at most; longest wait of a frame %.1f ms\n", frames,
            gate.submitted, gate.most, longest);
    camsplat_plan_free(job.plan);
    camsplat_device_close(device);
    vkDestroyFence(host.device, frame.fence, NULL);
    vkDestroyCommandPool(host.device, frame.pool, NULL);
    destroy_host(&host);
    return 0;
}
