#pragma once
// Things to put into a world, made of its simple surfaces. All stand upright, turned about z by
// `yaw` [rad]; positions are of the foot's centre; sizes are x, y, z extents before the turn [m].

#include <Eigen/Core>
#include <cstdint>

#include "drivers/simulated/world.hpp"

namespace swiftlet {

/// How a surface looks and what it is.
struct Finish {
  Material material = Material::kWood;
  Label label = Label::kBox;
  std::uint32_t paint_seed = 0;
};

struct Place {
  Eigen::Vector3d foot = Eigen::Vector3d::Zero();
  double yaw = 0;
};

void addBox(World& world, const Place& place, const Eigen::Vector3d& size, const Finish& finish);
/// The six sides get `finish`, the one towards +y (before the turn) gets `front`.
void addBox(World& world, const Place& place, const Eigen::Vector3d& size, const Finish& finish,
            const Finish& front);
void addUprightCylinder(World& world, const Place& place, double radius, double height, const Finish& finish,
                        bool lid);
void addTable(World& world, const Place& place, const Eigen::Vector3d& size, std::uint32_t seed);
void addChair(World& world, const Place& place, std::uint32_t seed);
void addShelf(World& world, const Place& place, const Eigen::Vector3d& size, std::uint32_t seed);
void addMachine(World& world, const Place& place, const Eigen::Vector3d& size, std::uint32_t seed);
/// One to three cartons on each other.
void addStack(World& world, const Place& place, double edge, int count, std::uint32_t seed);

}  // namespace swiftlet
