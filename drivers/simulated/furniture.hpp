#pragma once
// Objects for a world, made of its simple surfaces. All stand upright, rotated about z by `yaw` [rad];
// positions are those of the base's centre; sizes are x, y, z extents before the rotation [m].

#include <Eigen/Core>
#include <cstdint>

#include "drivers/simulated/world.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet {

/// Appearance and class of a surface.
struct Finish {
  Material material = Material::kWood;
  Label label = Label::kBox;
  std::uint32_t paint_seed = 0;
};

struct Place {
  Eigen::Vector3d foot = Eigen::Vector3d::Zero();
  double yaw = 0;
};

/// Uniform in a box; z is drawn first. In one expression the compiler would choose the order, and so the
/// world.
[[nodiscard]] Eigen::Vector3d drawVector(Random& random, const Eigen::Vector3d& low,
                                         const Eigen::Vector3d& high);

void addBox(World& world, const Place& place, const Eigen::Vector3d& size, const Finish& finish);
/// The side towards +y (before the rotation) gets `front`, the others `finish`.
void addBox(World& world, const Place& place, const Eigen::Vector3d& size, const Finish& finish,
            const Finish& front);
void addUprightCylinder(World& world, const Place& place, double radius, double height, const Finish& finish,
                        bool lid);
void addTable(World& world, const Place& place, const Eigen::Vector3d& size, std::uint32_t seed);
void addChair(World& world, const Place& place, std::uint32_t seed);
void addShelf(World& world, const Place& place, const Eigen::Vector3d& size, std::uint32_t seed);
void addMachine(World& world, const Place& place, const Eigen::Vector3d& size, std::uint32_t seed);
/// A stack of one to three cartons.
void addStack(World& world, const Place& place, double edge, int count, std::uint32_t seed);

}  // namespace swiftlet
