#include "drivers/simulated/furniture.hpp"

#include <cmath>
#include <numbers>

namespace swiftlet {
namespace {

struct Frame {
  Eigen::Vector3d foot;
  Eigen::Vector3d x;
  Eigen::Vector3d y;

  explicit Frame(const Place& place)
      : foot(place.foot),
        x(std::cos(place.yaw), std::sin(place.yaw), 0),
        y(-std::sin(place.yaw), std::cos(place.yaw), 0) {}
  [[nodiscard]] Eigen::Vector3d at(double a, double b, double c) const {
    return foot + a * x + b * y + c * Eigen::Vector3d::UnitZ();
  }
};

void addSide(World& world, const Eigen::Vector3d& origin, const Eigen::Vector3d& u_axis, double u_length,
             const Eigen::Vector3d& v_axis, double v_length, const Finish& finish, std::uint32_t salt) {
  Patch patch;
  patch.label = finish.label;
  patch.material = finish.material;
  patch.paint_seed = finish.paint_seed * 7 + salt;
  patch.origin = origin;
  patch.u_axis = u_axis;
  patch.v_axis = v_axis;
  patch.u_length = u_length;
  patch.v_length = v_length;
  world.add(patch);
}

}  // namespace

void addBox(World& world, const Place& place, const Eigen::Vector3d& size, const Finish& finish,
            const Finish& front) {
  const Frame f(place);
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const double a = 0.5 * size.x();
  const double b = 0.5 * size.y();
  const double h = size.z();
  addSide(world, f.at(-a, -b, 0), f.x, size.x(), z, h, finish, 0);           // towards -y
  addSide(world, f.at(a, b, 0), -f.x, size.x(), z, h, front, 1);             // towards +y
  addSide(world, f.at(a, -b, 0), f.y, size.y(), z, h, finish, 2);            // towards +x
  addSide(world, f.at(-a, b, 0), -f.y, size.y(), z, h, finish, 3);           // towards -x
  addSide(world, f.at(-a, -b, h), f.x, size.x(), f.y, size.y(), finish, 4);  // top
  addSide(world, f.at(-a, b, 0), f.x, size.x(), -f.y, size.y(), finish, 5);  // bottom
}

void addBox(World& world, const Place& place, const Eigen::Vector3d& size, const Finish& finish) {
  addBox(world, place, size, finish, finish);
}

void addUprightCylinder(World& world, const Place& place, double radius, double height, const Finish& finish,
                        bool lid) {
  const Frame f(place);
  Patch side;
  side.shape = Shape::kCylinder;
  side.label = finish.label;
  side.material = finish.material;
  side.paint_seed = finish.paint_seed;
  side.origin = place.foot;
  side.u_axis = f.x;
  side.u_length = 2 * std::numbers::pi * radius;
  side.v_length = height;
  side.radius = radius;
  world.add(side);
  if (!lid) return;
  Patch top = side;
  top.shape = Shape::kDisc;
  top.origin = f.at(-radius, -radius, height);
  top.v_axis = f.y;
  top.u_length = top.v_length = 2 * radius;
  top.paint_seed += 1;
  world.add(top);
}

void addTable(World& world, const Place& place, const Eigen::Vector3d& size, std::uint32_t seed) {
  constexpr double kTop = 0.05;
  constexpr double kLeg = 0.06;
  const Frame f(place);
  const Finish finish{Material::kWood, Label::kTable, seed};
  addBox(world, {f.at(0, 0, size.z() - kTop), place.yaw}, {size.x(), size.y(), kTop}, finish);
  for (const double sx : {-1.0, 1.0}) {
    for (const double sy : {-1.0, 1.0}) {
      const Eigen::Vector3d foot = f.at(sx * (0.5 * size.x() - kLeg), sy * (0.5 * size.y() - kLeg), 0);
      addBox(world, {foot, place.yaw}, {kLeg, kLeg, size.z() - kTop}, finish);
    }
  }
}

void addChair(World& world, const Place& place, std::uint32_t seed) {
  constexpr double kWidth = 0.45;
  constexpr double kSeat = 0.46;  // m above the floor
  constexpr double kLeg = 0.04;
  const Frame f(place);
  const Finish frame{Material::kWood, Label::kChair, seed};
  const Finish cloth{Material::kFabric, Label::kChair, seed + 1};
  addBox(world, {f.at(0, 0, kSeat), place.yaw}, {kWidth, kWidth, 0.06}, cloth);
  addBox(world, {f.at(0, -0.5 * kWidth + 0.02, kSeat + 0.06), place.yaw}, {kWidth, 0.04, 0.42}, cloth);
  for (const double sx : {-1.0, 1.0}) {
    for (const double sy : {-1.0, 1.0}) {
      const Eigen::Vector3d foot = f.at(sx * (0.5 * kWidth - kLeg), sy * (0.5 * kWidth - kLeg), 0);
      addBox(world, {foot, place.yaw}, {kLeg, kLeg, kSeat}, frame);
    }
  }
}

void addShelf(World& world, const Place& place, const Eigen::Vector3d& size, std::uint32_t seed) {
  addBox(world, place, size, {Material::kWood, Label::kShelf, seed},
         {Material::kBooks, Label::kShelf, seed + 1});
}

void addMachine(World& world, const Place& place, const Eigen::Vector3d& size, std::uint32_t seed) {
  const Frame f(place);
  const Finish metal{Material::kMetal, Label::kMachine, seed};
  addBox(world, place, {size.x(), size.y(), 0.6 * size.z()}, metal);
  const Eigen::Vector3d head = f.at(-0.15 * size.x(), 0, 0.6 * size.z());
  addBox(world, {head, place.yaw}, {0.6 * size.x(), 0.7 * size.y(), 0.4 * size.z()}, metal,
         {Material::kPoster, Label::kMachine, seed + 2});
  addUprightCylinder(world, {f.at(0.33 * size.x(), 0.1 * size.y(), 0.6 * size.z()), place.yaw},
                     0.13 * size.x(), 0.32 * size.z(), {Material::kChecker, Label::kMachine, seed + 3}, true);
}

Eigen::Vector3d drawVector(Random& random, const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  Eigen::Vector3d drawn;
  for (int i = 2; i >= 0; --i) drawn[i] = random.uniform(low[i], high[i]);
  return drawn;
}

void addStack(World& world, const Place& place, double edge, int count, std::uint32_t seed) {
  Random random(seed, 31);
  Place at = place;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d size = edge * drawVector(random, {0.8, 0.7, 0.5}, {1.2, 1.1, 1.0});
    at.yaw = place.yaw + random.uniform(-0.5, 0.5);
    addBox(world, at, size, {Material::kCarton, Label::kBox, seed + static_cast<std::uint32_t>(i) * 13});
    at.foot.z() += size.z();
    edge *= 0.75;
  }
}

}  // namespace swiftlet
