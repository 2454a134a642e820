// The elements' forces on a processor with vectors, in one precision or the other.
#include <math.h>

#define INLINE static inline __attribute__((always_inline))
#define X(row) x[(row) * 16]
#define LANES 16

#include "equations.h"

void element_forces(
    int block_count, long node_count, const double* position, const int* corner_node,
    const real* quick_data, const int* quick_start, const real* general_data,
    const int* general_start, const real* shared, real* corner_force
) {
    for (int block = 0; block < block_count; block++) {
        const int* node = corner_node + block * 8 * LANES;
        real* corner = corner_force + block * 24 * LANES;
        for (int k = 0; k < 8; k++)
            for (int d = 0; d < 3; d++)
                for (int lane = 0; lane < LANES; lane++)
                    corner[(3 * k + d) * LANES + lane] = (real)(
                        position[d * node_count + node[k * LANES + lane]]
                        - position[d * node_count + node[lane]]);
        const real* curvature = shared + block * 4 * LANES;
        if (quick_start[block] >= 0) {
            const real* data = quick_data + quick_start[block];
#pragma GCC ivdep
            for (int lane = 0; lane < LANES; lane++)
                quick_element(corner + lane, data + lane, curvature + lane);
        } else {
            const real* data = general_data + general_start[block];
#pragma GCC ivdep
            for (int lane = 0; lane < LANES; lane++)
                general_element(corner + lane, data + lane, curvature + lane);
        }
    }
}
