// GPU time of CUB's radix sort on the input of benches/primitives.rs, a line per size: "keys|pairs COUNT NANOSECONDS", the median of 41 runs.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include <cub/device/device_radix_sort.cuh>

static void check(cudaError_t code) {
    if (code != cudaSuccess) {
        std::fprintf(stderr, "radix_sort.cu: %s\n", cudaGetErrorString(code));
        std::exit(1);
    }
}

// Of Knuth's MMIX generator the upper half, as in primitives.rs.
static std::vector<uint32_t> random_keys(size_t count) {
    uint64_t state = 1;
    std::vector<uint32_t> keys(count);
    for (uint32_t &key : keys) {
        state = state * 6364136223846793005u + 1442695040888963407u;
        key = uint32_t(state >> 32);
    }
    return keys;
}

static void measure(size_t count, bool has_values) {
    std::vector<uint32_t> keys = random_keys(count);
    uint32_t *input, *buffers[4];
    check(cudaMalloc(&input, 4 * count));
    for (uint32_t *&buffer : buffers) check(cudaMalloc(&buffer, 4 * count));
    check(cudaMemcpy(input, keys.data(), 4 * count, cudaMemcpyHostToDevice));
    check(cudaMemset(buffers[2], 0, 4 * count));
    void *scratch = nullptr;
    size_t bytes = 0;
    const uint32_t *sorted = nullptr;
    auto sort = [&] {
        cub::DoubleBuffer<uint32_t> both_keys(buffers[0], buffers[1]), both_values(buffers[2], buffers[3]);
        check(has_values ? cub::DeviceRadixSort::SortPairs(scratch, bytes, both_keys, both_values, int(count))
                         : cub::DeviceRadixSort::SortKeys(scratch, bytes, both_keys, int(count)));
        sorted = both_keys.Current();
    };
    sort();
    check(cudaMalloc(&scratch, bytes));
    cudaEvent_t start, stop;
    check(cudaEventCreate(&start));
    check(cudaEventCreate(&stop));
    std::vector<float> times;
    for (int run = 0; run < 46; run++) {
        check(cudaMemcpy(buffers[0], input, 4 * count, cudaMemcpyDeviceToDevice));
        check(cudaEventRecord(start));
        sort();
        check(cudaEventRecord(stop));
        check(cudaEventSynchronize(stop));
        float milliseconds;
        check(cudaEventElapsedTime(&milliseconds, start, stop));
        if (run >= 5) times.push_back(milliseconds);
    }
    std::vector<uint32_t> found(count);
    check(cudaMemcpy(found.data(), sorted, 4 * count, cudaMemcpyDeviceToHost));
    std::sort(keys.begin(), keys.end());
    if (found != keys) {
        std::fprintf(stderr, "radix_sort.cu: a sort went wrong\n");
        std::exit(1);
    }
    std::nth_element(times.begin(), times.begin() + times.size() / 2, times.end());
    std::printf("%s %zu %.0f\n", has_values ? "pairs" : "keys", count, 1e6 * times[times.size() / 2]);
    check(cudaFree(scratch));
    check(cudaFree(input));
    for (uint32_t *buffer : buffers) check(cudaFree(buffer));
}

int main(int count, char **sizes) {
    for (int i = 1; i < count; i++) {
        for (bool has_values : {false, true}) measure(std::strtoull(sizes[i], nullptr, 10), has_values);
    }
}
