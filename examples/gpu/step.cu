// A step of a sheet on a graphics processor: three kernels, one thread per element or node.
// `real` is the kind of number of the elements' forces; nodes are moved in double precision.
#define INLINE __device__ __forceinline__
#define X(row) x[row]
#define LANES 16

#define TABLE static __device__ const

#include "equations.h"

// Positions of the corners from the first one on: a number of single precision that holds a
// difference keeps its digits, one that holds a position does not.
INLINE void load_corners(real* x, const double* position, int node_count, const int* node) {
    const double first[3] = {
        position[node[0]], position[node_count + node[0]], position[2 * node_count + node[0]]
    };
    for (int corner = 0; corner < 8; corner++)
        for (int d = 0; d < 3; d++)
            x[3 * corner + d] = real(position[d * node_count + node[corner * LANES]] - first[d]);
}

extern "C" __global__ void element_forces(
    int element_count, int node_count, const double* position, const int* corner_node,
    const real* quick_data, const int* quick_start, const real* general_data,
    const int* general_start, const real* shared, real* corner_force
) {
    const int element = blockIdx.x * blockDim.x + threadIdx.x;
    if (element >= element_count) return;
    const int block = element / LANES, lane = element % LANES;
    real x[24];
    load_corners(x, position, node_count, corner_node + block * 8 * LANES + lane);
    const real* curvature = shared + block * 4 * LANES + lane;
    if (quick_start[block] >= 0)
        quick_element(x, quick_data + quick_start[block] + lane, curvature);
    else
        general_element(x, general_data + general_start[block] + lane, curvature);
    for (int row = 0; row < 24; row++)
        corner_force[(block * 24 + row) * LANES + lane] = x[row];
}

// middle_nodes : (5, 2, middle_count) nodes of the sheet below and above the node of the
// mid-surface, then of its neighbours.
extern "C" __global__ void fibre_bending(
    int middle_count, int node_count, const double* position, const int* middle_nodes,
    const real* constants_of_all, const int* start, real* sent_by_all
) {
    const int middle = blockIdx.x * blockDim.x + threadIdx.x;
    if (middle >= middle_count) return;
    const int block = middle / LANES, lane = middle % LANES;
    real p[5][3], sent[12];
    double first[3];
    for (int k = 0; k < 5; k++) {
        const int below = middle_nodes[2 * k * middle_count + middle];
        const int above = middle_nodes[(2 * k + 1) * middle_count + middle];
        for (int d = 0; d < 3; d++) {
            const double here = 0.5 * (position[d * node_count + below] + position[d * node_count + above]);
            if (k == 0) first[d] = here;
            p[k][d] = real(here - first[d]);
        }
    }
    bending(p, constants_of_all + start[block] + lane, sent);
    for (int row = 0; row < 12; row++) sent_by_all[(block * 12 + row) * LANES + lane] = sent[row];
}

#ifdef TOOLS
struct Contact {
    const double *area, *impedance, *offset, *travel, *speed;
    double penalty, tangential_ratio, damping_ratio, weight;
};

// Adds the contact with all tools to the forces on a node. A tool knows of the forces of the tools
// before it, and of the springs of those behind it. stick : (tools, 3, node_count).
INLINE void add_contact(
    int step, int node_count, int node, const Contact& c, const double* position,
    const double* velocity, double inverse_mass, double dt, double* stick_of_all, double* force
) {
    const double p[3] = {
        position[node], position[node_count + node], position[2 * node_count + node]
    };
    const double stiffness = c.penalty * c.area[node];
    const double damping = c.damping_ratio * 2.0 * sqrt(c.penalty) * c.impedance[node];
    const double constants[5] = {
        inverse_mass, c.weight, stiffness, c.tangential_ratio * stiffness, damping
    };
    double gap[TOOLS], n[TOOLS][3], pending[3] = {0.0, 0.0, 0.0};
    for (int tool = 0; tool < TOOLS; tool++) {
        distance_of_tool(tool, p, c.travel[step * TOOLS + tool], &gap[tool], n[tool]);
        gap[tool] -= c.offset[node] - OVERLAP[tool];
        if (gap[tool] < 0.0)
            for (int d = 0; d < 3; d++) pending[d] -= stiffness * gap[tool] * n[tool][d];
    }
    for (int tool = 0; tool < TOOLS; tool++) {
        double* kept = stick_of_all + 3 * tool * node_count + node;
        double stick[3] = {kept[0], kept[node_count], kept[2 * node_count]};
        const bool held = stick[0] != 0.0 || stick[1] != 0.0 || stick[2] != 0.0;
        if (gap[tool] >= 0.0 && !held) continue;
        double against[3], others[3], drag[3];
        for (int d = 0; d < 3; d++) {
            if (gap[tool] < 0.0) pending[d] += stiffness * gap[tool] * n[tool][d];
            others[d] = force[d] + pending[d];
            against[d] = velocity[d * node_count + node]
                - c.speed[step * TOOLS + tool] * DIRECTION[3 * tool + d];
        }
        const double pressure = press(constants, gap[tool], n[tool], against, others, dt);
        rub(constants, gap[tool], n[tool], against, FRICTION[tool] * pressure, dt, stick, drag);
        for (int d = 0; d < 3; d++) {
            force[d] += pressure * n[tool][d] + drag[d];
            kept[d * node_count] = stick[d];
        }
    }
}
#endif

// slot : (valence, node_count) where a node finds its corner forces. source : (4, middle_count)
// where it finds what its neighbours send. middle_of_node : -1 without a mid-surface.
extern "C" __global__ void move_nodes(
    int node_count, int valence, int middle_count, const int* slot, const real* corner_force,
    const int* middle_of_node, const int* source, const real* sent, const real* share,
    const double* inverse_mass, double* position, double* velocity, double dt, double damping
#ifdef TOOLS
    , int step, const double* area, const double* impedance, const double* offset,
    const double* travel, const double* speed, double penalty, double tangential_ratio,
    double damping_ratio, double weight, double* stick
#endif
) {
    const int node = blockIdx.x * blockDim.x + threadIdx.x;
    if (node >= node_count) return;
    double force[3] = {0.0, 0.0, 0.0};
    for (int s = 0; s < valence; s++) {
        const int place = slot[s * node_count + node];
        for (int d = 0; d < 3; d++) force[d] -= corner_force[place + d * LANES];
    }
    const int middle = middle_of_node[node];
    if (middle >= 0) {
        const int own = middle / LANES * 12 * LANES + middle % LANES;
        for (int d = 0; d < 3; d++) {
            double received = 0.0, given = 0.0;
            for (int k = 0; k < 4; k++) {
                received += sent[source[k * middle_count + middle] + d * LANES];
                given += sent[own + (3 * k + d) * LANES];
            }
            force[d] -= share[middle] * (received - given);
        }
    }
#ifdef TOOLS
    const Contact contact = {
        area, impedance, offset, travel, speed, penalty, tangential_ratio, damping_ratio, weight
    };
    add_contact(
        step, node_count, node, contact, position, velocity, inverse_mass[node], dt, stick, force
    );
    force[2] -= weight / inverse_mass[node];
#endif
    const double half = 0.5 * damping * dt, inertia = inverse_mass[node];
    for (int d = 0; d < 3; d++) {
        const int i = d * node_count + node;
        const double now = ((1.0 - half) * velocity[i] + dt * force[d] * inertia) / (1.0 + half);
        velocity[i] = now;
        position[i] += dt * now;
    }
}
