// How many elements there are: the host's number, or a device counter that the host's number bounds. Include after the
// push constants `count` and `count_index` and the buffer `counts`.
uint element_count() {
    return count_index == 0xffffffffu ? count : min(count, counts[count_index]);
}
