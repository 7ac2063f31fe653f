#pragma once
// Paints materials as reflectance by surface coordinates: detailed like real surfaces (print, bricks, books),
// plain where those are plain (plaster, lamps), and repetitive where those repeat.
//
// Source of the fractal noise: value noise summed over octaves (Ebert et al., "Texturing and
// Modeling", 2003, chapter 2).

#include <cstdint>
#include <vector>

#include "drivers/simulated/world.hpp"

namespace swiftlet {

/// Reflectance 0 to 1 as floats, row-major, texel centres at ((x + 0.5), (y + 0.5)) / per_metre.
std::vector<float> paintPatch(const Patch& patch, int width, int height, double per_metre);

}  // namespace swiftlet
