// Films with a time axis: twin of crates/lumbre-light/src/film/time.rs and of crates/lumbre-render/src/cpu/films/time_film.rs.
// Without TIMES splats are added to the picture, and nothing else happens. Positions on the axis need
// double precision.
#ifndef FILM_TIME_GLSL
#define FILM_TIME_GLSL

#ifdef EXTENDED
#include "math/trig.glsl"
#include "transport/bsdf/beckmann.glsl"

// Sums of the samples, [pixel][slot].
layout(set = 0, binding = 27, scalar) buffer TimeRows { SlotSums time_sums[]; };
// Value of the current sample for each slot of its own pixel, [pixel][slot]; black between samples.
layout(set = 0, binding = 28, scalar) buffer TimeValues { vec3 time_values[]; };

// The slots that received light from the current sample, up to a maximum; beyond it all slots are
// visited.
const uint MAX_TOUCHED = 24u;
uint time_touched[MAX_TOUCHED];
uint time_count;

// Returns the position of an optical length in bins from the start.
double time_position(double optical) {
    return (optical - packDouble2x32(job.time_start)) / packDouble2x32(job.time_bin);
}

// Returns the slot of a position in bins; NaN is in the overflow slot.
uint time_slot(double place) {
    if (is_finite(place)) {
        if (place < 0.0lf) {
            return 0u;
        }
        if (place < double(job.time_bins)) {
            return min(uint(place) + 1u, job.time_bins);
        }
    } else if ((unpackDouble2x32(place).y & 0x800fffffu) == 0x80000000u) {
        return 0u;
    }
    return job.time_bins + 1u;
}

// erf(3 / sqrt 2): the fraction of a Gaussian within three standard deviations.
const float TIME_CUT = 0.9973002039367398;

// Returns the fraction of the filter about `place` that lies below `x`.
double time_below(double x, double place, double reach) {
    double t = clamp(x - place, -reach, reach);
    if (job.time_filter == TIME_FILTER_BOX) {
        return 0.5lf + 0.5lf * t / reach;
    }
    float s = float(t / packDouble2x32(job.time_radius)) / SQRT_2;
    return 0.5lf + 0.5lf * double(erf(s) / TIME_CUT);
}

void time_add(uint at, uint slot, vec3 value) {
    if (time_values[at] == vec3(0.0)) {
        if (time_count < MAX_TOUCHED) {
            time_touched[time_count] = slot;
        }
        time_count += 1u;
    }
    time_values[at] += value;
}

// Spreads a contribution to a pixel over its slots; returns whether all of it was accepted.
bool time_spread(bool own, uint pixel, Contribution c) {
    double place = time_position(c.optical_length);
    double reach = job.time_filter == TIME_FILTER_NONE || !is_finite(place)
        ? 0.0lf
        : packDouble2x32(job.time_radius);
    reach *= job.time_filter == TIME_FILTER_GAUSS ? 3.0lf : 1.0lf;
    uint first = time_slot(place - reach), last = time_slot(place + reach);
    double before = 0.0lf;
    bool taken = true;
    [[dont_unroll]] for (uint slot = first; slot <= last; ++slot) {
        double until = slot == last ? 1.0lf : time_below(double(slot), place, reach);
        if (until > before) {
            float share = float(until - before);
            before = until;
            uint at = pixel * time_slots() + slot;
            if (own) {
                time_add(at, slot, c.value * share);
            } else {
                taken = splat_add(at, c.value * share) && taken;
            }
        }
    }
    return taken;
}

// Adds the values of a sample to the sums if the picture accepted it (`counts`), and blackens them.
// Returns whether no sum of squares overflowed.
bool time_add_sample(uint pixel, bool counts) {
    bool all_slots = time_count > MAX_TOUCHED;
    uint count = all_slots ? time_slots() : time_count;
    bool room = true;
    for (uint i = 0u; i < count; i++) {
        uint at = pixel * time_slots() + (all_slots ? i : time_touched[i]);
        vec3 value = time_values[at];
        time_values[at] = vec3(0.0);
        if (counts && value != vec3(0.0)) {
            SlotSums sums = time_sums[at];
            add_exactly(sums.sum, sums.sum_rest, value);
            sums.square += value * value;
            room = room && finite(sums.square);
            time_sums[at] = sums;
        }
    }
    return room;
}
#endif

void time_begin() {
#ifdef EXTENDED
    time_count = 0u;
#endif
}

void time_own(uint pixel, Contribution c) {
#ifdef EXTENDED
    if (TIMES) {
        time_spread(true, pixel, c);
    }
#endif
}

bool time_splat(uint pixel, Contribution c) {
#ifdef EXTENDED
    if (TIMES) {
        return time_spread(false, pixel, c);
    }
#endif
    return splat_add(pixel, c.value);
}

// Ends a sample; `counts` is whether the picture accepted it. Returns 1 if a sum of squares
// overflowed, else 0.
uint time_close(uint pixel, bool counts) {
#ifdef EXTENDED
    if (TIMES && !time_add_sample(pixel, counts)) {
        return 1u;
    }
#endif
    return 0u;
}

#endif
