// The worlds: walls, floors, ceilings with lamps, and furniture kept clear of the flight path.

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "drivers/simulated/furniture.hpp"
#include "drivers/simulated/world.hpp"

namespace swiftlet {
namespace {

using Eigen::Vector3d;

constexpr double kClearance = 0.5;    // m kept free around the flight path
constexpr double kWallMargin = 1.5;   // m between a given motion and the walls around it
constexpr double kFloorMargin = 0.6;  // m below its lowest point
constexpr double kPosterGap = 0.012;  // m between a poster and its wall
constexpr double kTwinSide = 6.0;     // m
constexpr double kTwinHeight = 3.0;
constexpr double kTwinOffset = 5.0;  // m from a twin room's centre to the middle
constexpr double kTwinDoor = 1.4;    // m wide
constexpr double kTwinDoorHeight = 2.3;
constexpr double kTwinWall = 0.2;  // m thick
constexpr double kPassage = 2.2;   // m, width of corridors
constexpr double kRingX = 14.0;
constexpr double kRingY = 10.0;
constexpr double kRingHeight = 2.8;

struct Wall {
  Vector3d corner;  // lower left, seen from its visible side
  Vector3d along;   // unit, to the right
  double length = 0;
  double height = 0;
};

void addFlat(World& world, const Vector3d& origin, const Vector3d& u, double u_length, const Vector3d& v,
             double v_length, const Finish& finish) {
  Patch patch;
  patch.origin = origin;
  patch.u_axis = u;
  patch.v_axis = v;
  patch.u_length = u_length;
  patch.v_length = v_length;
  patch.label = finish.label;
  patch.material = finish.material;
  patch.paint_seed = finish.paint_seed;
  world.add(patch);
}

void addWall(World& world, const Wall& wall, Material material, std::uint32_t seed) {
  addFlat(world, wall.corner, wall.along, wall.length, Vector3d::UnitZ(), wall.height,
          {material, Label::kWall, seed});
}

// A wall with a doorway from `left` to `right` along it.
void addWallWithDoor(World& world, const Wall& wall, double left, double right, Material material,
                     std::uint32_t seed) {
  addWall(world, {wall.corner, wall.along, left, wall.height}, material, seed);
  addWall(world, {wall.corner + right * wall.along, wall.along, wall.length - right, wall.height}, material,
          seed + 1);
  addWall(world,
          {wall.corner + left * wall.along + kTwinDoorHeight * Vector3d::UnitZ(), wall.along, right - left,
           wall.height - kTwinDoorHeight},
          material, seed + 2);
}

// Posters and boards of different size that do not overlap.
void hangPosters(World& world, const Wall& wall, double per_metre, Random& random) {
  double at = 0.3;
  const Vector3d out = wall.along.cross(Vector3d::UnitZ());
  while (at < wall.length - 0.6) {
    const double width = std::min(random.uniform(0.35, 1.4), wall.length - 0.2 - at);
    const double height = std::min(random.uniform(0.4, 1.1), 0.5 * wall.height);
    const double low = random.uniform(0.15 * wall.height, wall.height - height - 0.1);
    const auto seed = random.next();
    if (random.uniform() < per_metre) {
      addFlat(world, wall.corner + at * wall.along + low * Vector3d::UnitZ() + kPosterGap * out, wall.along,
              width, Vector3d::UnitZ(), height, {Material::kPoster, Label::kPoster, seed});
    }
    at += width + random.uniform(0.1, 0.8);
  }
}

// Lamps on the ceiling in a grid about 3 m wide.
void hangLamps(World& world, const Vector3d& centre, const Vector3d& size) {
  const int nx = std::max(1, static_cast<int>(std::lround(size.x() / 3.5)));
  const int ny = std::max(1, static_cast<int>(std::lround(size.y() / 3.5)));
  for (int i = 0; i < nx; ++i) {
    for (int j = 0; j < ny; ++j) {
      const Vector3d at(centre.x() + size.x() * ((i + 0.5) / nx - 0.5),
                        centre.y() + size.y() * ((j + 0.5) / ny - 0.5), centre.z() + size.z());
      world.addLamp({at - Vector3d(0, 0, 0.12), size.x() * size.y() / (nx * ny)});
      addBox(world, {at - Vector3d(0, 0, 0.08), 0.0}, {1.0, 0.25, 0.08}, {Material::kLamp, Label::kLamp, 5});
    }
  }
}

// Decides where objects may stand: away from the flight path and from each other.
class Ground {
 public:
  Ground(const Vector3d& centre, const Vector3d& size, std::vector<Vector3d> clear)
      : centre_(centre), size_(size), clear_(std::move(clear)) {}

  // A free place for an object with this footprint radius and height, or false after some attempts.
  bool find(Random& random, double radius, double height, bool at_wall, Place& place) {
    constexpr int kTries = 40;
    for (int attempt = 0; attempt < kTries; ++attempt) {
      const double reach_x = 0.5 * size_.x() - radius - 0.02;
      const double reach_y = 0.5 * size_.y() - radius - 0.02;
      Vector3d p = Vector3d::Zero();
      p.y() = random.uniform(-reach_y, reach_y);
      p.x() = random.uniform(-reach_x, reach_x);
      double yaw = random.uniform(0.0, 2 * std::numbers::pi);
      if (at_wall) {
        const std::uint32_t side = random.below(4);
        yaw = std::numbers::pi * 0.5 * side;  // front away from the wall behind it
        const std::array<Vector3d, 4> stands{Vector3d(p.x(), -reach_y, 0), Vector3d(reach_x, p.y(), 0),
                                             Vector3d(p.x(), reach_y, 0), Vector3d(-reach_x, p.y(), 0)};
        p = stands[side];
      }
      p += centre_;
      if (!isFree(p, radius, height)) continue;
      taken_.push_back({p, radius});
      place = {p, yaw};
      return true;
    }
    return false;
  }

 private:
  struct Taken {
    Vector3d foot;
    double radius = 0;
  };
  [[nodiscard]] bool isFree(const Vector3d& p, double radius, double height) const {
    for (const Taken& other : taken_) {
      if ((other.foot - p).head<2>().norm() < other.radius + radius) return false;
    }
    return std::none_of(clear_.begin(), clear_.end(), [&](const Vector3d& q) {
      const double aside = std::max(0.0, (q - p).head<2>().norm() - radius);
      const double above = std::max(0.0, q.z() - p.z() - height);
      return std::hypot(aside, above) < kClearance;
    });
  }
  Vector3d centre_;
  Vector3d size_;
  std::vector<Vector3d> clear_;
  std::vector<Taken> taken_;
};

struct Furnishing {
  int shelves = 0;
  int tables = 0;
  int chairs = 0;
  int stacks = 0;
  int machines = 0;
  int pillars = 0;
  int barrels = 0;
  int balls = 0;
  int mats = 0;
};

void putThings(World& world, Ground& ground, const Vector3d& size, const Furnishing& things, Random& random) {
  Place place;
  for (int i = 0; i < things.shelves; ++i) {
    const double height = std::min(random.uniform(1.4, 2.3), size.z() - 0.4);
    const Vector3d extent(random.uniform(0.9, 1.6), 0.35, height);
    if (ground.find(random, 0.5 * extent.x(), extent.z(), true, place)) {
      // The place keeps a circle free of the wall; the shelf is moved back against it.
      const Vector3d back(std::sin(place.yaw), -std::cos(place.yaw), 0);
      place.foot += (0.5 * extent.x() - 0.5 * extent.y()) * back;
      addShelf(world, place, extent, random.next());
    }
  }
  for (int i = 0; i < things.pillars; ++i) {
    const double radius = random.uniform(0.15, 0.3);
    if (ground.find(random, radius, size.z(), false, place)) {
      addUprightCylinder(world, place, radius, size.z(), {Material::kBrick, Label::kPillar, random.next()},
                         false);
    }
  }
  for (int i = 0; i < things.machines; ++i) {
    const Vector3d extent = drawVector(random, {1.0, 0.8, 1.2}, {2.0, 1.4, 2.4});
    if (ground.find(random, 0.5 * extent.head<2>().norm(), extent.z(), false, place)) {
      addMachine(world, place, extent, random.next());
    }
  }
  for (int i = 0; i < things.tables; ++i) {
    const Vector3d extent = drawVector(random, {0.9, 0.6, 0.65}, {1.5, 0.9, 0.85});
    const bool at_wall = random.uniform() < 0.6;
    if (ground.find(random, 0.5 * extent.head<2>().norm(), extent.z() + 0.5, at_wall, place)) {
      const std::uint32_t seed = random.next();
      addTable(world, place, extent, seed);
      place.foot.z() += extent.z();
      addStack(world, place, 0.35, 1 + static_cast<int>(seed % 2), seed);
    }
  }
  for (int i = 0; i < things.stacks; ++i) {
    const double edge = random.uniform(0.3, 0.75);
    const int count = 1 + static_cast<int>(random.below(3));
    if (ground.find(random, 0.85 * edge, edge * count, false, place)) {
      addStack(world, place, edge, count, random.next());
    }
  }
  for (int i = 0; i < things.chairs; ++i) {
    if (ground.find(random, 0.33, 0.95, false, place)) addChair(world, place, random.next());
  }
  for (int i = 0; i < things.barrels; ++i) {
    const double radius = random.uniform(0.2, 0.32);
    if (ground.find(random, radius, 0.9, false, place)) {
      const std::uint32_t seed = random.next();
      addUprightCylinder(world, place, radius, random.uniform(0.6, 0.9),
                         {Material::kChecker, Label::kBarrel, seed}, true);
    }
  }
  for (int i = 0; i < things.balls; ++i) {
    const double radius = random.uniform(0.12, 0.35);
    if (!ground.find(random, radius, 2 * radius, false, place)) continue;
    Patch ball;
    ball.shape = Shape::kSphere;
    ball.label = Label::kBall;
    ball.material = Material::kFabric;
    ball.paint_seed = random.next();
    ball.origin = place.foot + Vector3d(0, 0, radius);
    ball.radius = radius;
    ball.u_length = 2 * std::numbers::pi * radius;
    ball.v_length = std::numbers::pi * radius;
    world.add(ball);
  }
}

// Mats and printed boards on the floor that do not overlap.
void layMats(World& world, const Vector3d& centre, const Vector3d& size, int count, Random& random) {
  std::vector<Eigen::Vector2d> laid;
  for (int i = 0; i < count; ++i) {
    const double a = random.uniform(0.5, 1.3);
    const double b = random.uniform(0.4, 1.0);
    const double yaw = random.uniform(0.0, 2 * std::numbers::pi);
    const double aside = random.uniform(-0.4, 0.4) * size.y();
    const Vector3d at = centre + Vector3d(random.uniform(-0.4, 0.4) * size.x(), aside, 0.004);
    const std::uint32_t seed = random.next();
    if (std::any_of(laid.begin(), laid.end(),
                    [&](const auto& other) { return (other - at.head<2>()).norm() < 1.7; })) {
      continue;
    }
    laid.push_back(at.head<2>());
    const Vector3d x(std::cos(yaw), std::sin(yaw), 0);
    const Vector3d y(-std::sin(yaw), std::cos(yaw), 0);
    addFlat(world, at - 0.5 * a * x - 0.5 * b * y, x, a, y, b, {Material::kPoster, Label::kFloor, seed});
  }
}

std::array<Wall, 4> roomWalls(const Vector3d& c, const Vector3d& size) {
  const double a = 0.5 * size.x();
  const double b = 0.5 * size.y();
  return {Wall{c + Vector3d(-a, b, 0), Vector3d::UnitX(), size.x(), size.z()},    // north, seen from inside
          Wall{c + Vector3d(a, b, 0), -Vector3d::UnitY(), size.y(), size.z()},    // east
          Wall{c + Vector3d(a, -b, 0), -Vector3d::UnitX(), size.x(), size.z()},   // south
          Wall{c + Vector3d(-a, -b, 0), Vector3d::UnitY(), size.y(), size.z()}};  // west
}

void addFloorAndCeiling(World& world, const Vector3d& c, const Vector3d& size, Material floor,
                        Material ceiling, std::uint32_t seed) {
  const double a = 0.5 * size.x();
  const double b = 0.5 * size.y();
  addFlat(world, c + Vector3d(-a, -b, 0), Vector3d::UnitX(), size.x(), Vector3d::UnitY(), size.y(),
          {floor, Label::kFloor, seed});
  addFlat(world, c + Vector3d(-a, b, size.z()), Vector3d::UnitX(), size.x(), -Vector3d::UnitY(), size.y(),
          {ceiling, Label::kCeiling, seed + 1});
}

Furnishing scaled(Furnishing things, double factor) {
  for (int* count : {&things.shelves, &things.tables, &things.chairs, &things.stacks, &things.machines,
                     &things.pillars, &things.barrels, &things.balls, &things.mats}) {
    *count = static_cast<int>(std::lround(factor * *count));
  }
  return things;
}

void buildBoxWorld(World& world, const WorldSettings& settings, const std::vector<Vector3d>& clear) {
  Random random(settings.seed, 41);
  const Vector3d size = worldSize(settings);
  const Vector3d centre = settings.floor_centre;
  const bool hall = settings.kind == WorldKind::kHall;
  const bool cluttered = settings.kind == WorldKind::kCluttered;
  const std::array<Material, 4> walls =
      hall ? std::array{Material::kBrick, Material::kConcrete, Material::kConcrete, Material::kBrick}
           : std::array{Material::kPlaster, Material::kBrick, Material::kFabric, Material::kConcrete};
  addFloorAndCeiling(world, centre, size, hall ? Material::kConcrete : Material::kTiles,
                     hall ? Material::kConcrete : Material::kPlaster, random.next());
  const auto sides = roomWalls(centre, size);
  for (std::size_t i = 0; i < 4; ++i) {
    addWall(world, sides[i], walls[i], random.next());
    hangPosters(world, sides[i], std::min(1.0, 0.6 * settings.clutter), random);
  }
  hangLamps(world, centre, size);
  Furnishing things{4, 3, 4, 6, 0, 0, 2, 2, 4};
  if (hall) things = {8, 4, 4, 16, 6, 4, 8, 3, 10};
  if (cluttered) things = {6, 5, 8, 14, 1, 3, 5, 5, 6};
  // Resized worlds keep their density.
  const Vector3d standard = worldSize({settings.kind, 0, 1, Vector3d::Zero(), Vector3d::Zero()});
  const double area = size.x() * size.y() / (standard.x() * standard.y());
  things = scaled(things, settings.clutter * std::clamp(area, 0.5, 4.0));
  layMats(world, centre, size, things.mats, random);
  Ground ground(centre, size, clear);
  putThings(world, ground, size, things, random);
}

void buildTwinRooms(World& world, const WorldSettings& settings, const std::vector<Vector3d>& clear) {
  const Vector3d size(kTwinSide, kTwinSide, kTwinHeight);
  const Vector3d middle = settings.floor_centre;
  const std::array<Vector3d, 2> centres{middle + Vector3d(-kTwinOffset, 0, 0),
                                        middle + Vector3d(kTwinOffset, 0, 0)};
  // Points that must be free in either room must be free in both.
  std::vector<Vector3d> local;
  for (const Vector3d& centre : centres) {
    for (const Vector3d& p : clear) local.push_back(p - centre);
  }
  const double left = 0.5 * (kTwinSide - kTwinDoor);
  const double right = left + kTwinDoor;
  for (const Vector3d& centre : centres) {
    Random random(settings.seed, 42);                                        // the same for both rooms
    world.setZone(static_cast<std::uint8_t>(&centre - centres.data() + 1));  // so that their light is equal
    addFloorAndCeiling(world, centre, size, Material::kParquet, Material::kPlaster, random.next());
    const auto sides = roomWalls(centre, size);
    constexpr std::array<Material, 4> kLooks{Material::kPlaster, Material::kBrick, Material::kPlaster,
                                             Material::kFabric};
    for (std::size_t i = 0; i < 4; ++i) {
      const std::uint32_t seed = random.next();
      if (i == 2) {
        addWallWithDoor(world, sides[i], left, right, kLooks[i], seed);
        hangPosters(world, {sides[i].corner, sides[i].along, left - 0.2, size.z()}, 0.8, random);
        continue;
      }
      addWall(world, sides[i], kLooks[i], seed);
      hangPosters(world, sides[i], 0.6, random);
    }
    hangLamps(world, centre, size);
    Furnishing things{3, 2, 3, 5, 0, 0, 1, 1, 2};
    things = scaled(things, settings.clutter);
    layMats(world, centre, size, things.mats, random);
    std::vector<Vector3d> here;
    here.reserve(local.size());
    for (const Vector3d& p : local) here.push_back(p + centre);
    Ground ground(centre, size, here);
    putThings(world, ground, size, things, random);
    // The doorway through the wall: sill, lintel and both jambs.
    const Vector3d in = centre + Vector3d(-0.5 * kTwinDoor, -0.5 * kTwinSide, 0);
    const Vector3d x = Vector3d::UnitX();
    const Vector3d y = Vector3d::UnitY();
    const Vector3d z = Vector3d::UnitZ();
    addFlat(world, in - kTwinWall * y, x, kTwinDoor, y, kTwinWall, {Material::kWood, Label::kFloor, 71});
    addFlat(world, in + kTwinDoorHeight * z, x, kTwinDoor, -y, kTwinWall,
            {Material::kWood, Label::kWall, 72});
    addFlat(world, in - kTwinWall * y, y, kTwinWall, z, kTwinDoorHeight, {Material::kWood, Label::kWall, 73});
    addFlat(world, in + kTwinDoor * x, -y, kTwinWall, z, kTwinDoorHeight,
            {Material::kWood, Label::kWall, 74});
  }

  // The corridor runs along both south walls.
  Random random(settings.seed, 43);
  world.setZone(0);
  const double half = kTwinOffset + 0.5 * kTwinSide;
  const Vector3d hall_size(2 * half, kPassage, kTwinHeight);
  const Vector3d hall_centre = middle + Vector3d(0, -0.5 * kTwinSide - kTwinWall - 0.5 * kPassage, 0);
  addFloorAndCeiling(world, hall_centre, hall_size, Material::kCarpet, Material::kPlaster, random.next());
  const auto sides = roomWalls(hall_centre, hall_size);
  const Wall& north = sides[0];
  const double west_door = half - kTwinOffset - 0.5 * kTwinDoor;
  addWallWithDoor(world, {north.corner, north.along, half, kTwinHeight}, west_door, west_door + kTwinDoor,
                  Material::kConcrete, random.next());
  const double east_door = kTwinOffset - 0.5 * kTwinDoor;  // from the middle
  addWallWithDoor(world, {north.corner + half * north.along, north.along, half, kTwinHeight}, east_door,
                  east_door + kTwinDoor, Material::kConcrete, random.next());
  hangPosters(world,
              {north.corner + (west_door + kTwinDoor + 0.2) * north.along, north.along,
               2 * (kTwinOffset - 0.5 * kTwinDoor - 0.2), kTwinHeight},
              0.8, random);
  for (const std::size_t i : {1U, 2U, 3U}) {
    addWall(world, sides[i], Material::kPlaster, random.next());
    hangPosters(world, sides[i], 0.8, random);
  }
  hangLamps(world, hall_centre, hall_size);
}

void buildCorridor(World& world, const WorldSettings& settings) {
  Random random(settings.seed, 44);
  const Vector3d size(kRingX, kRingY, kRingHeight);
  const Vector3d centre = settings.floor_centre;
  addFloorAndCeiling(world, centre, size, Material::kCarpet, Material::kPlaster, random.next());
  for (const Wall& wall : roomWalls(centre, size)) {
    const std::uint32_t seed = random.next();
    addWall(world, wall, random.uniform() < 0.5 ? Material::kPlaster : Material::kBrick, seed);
    hangPosters(world, wall, 0.7, random);
  }
  // The block in the middle, seen from outside: the walls of a room, reversed.
  const Vector3d core(kRingX - 2 * kPassage, kRingY - 2 * kPassage, kRingHeight);
  for (const Wall& inside : roomWalls(centre, core)) {
    const Wall wall{inside.corner + inside.length * inside.along, -inside.along, inside.length,
                    inside.height};
    const std::uint32_t seed = random.next();
    addWall(world, wall, random.uniform() < 0.5 ? Material::kConcrete : Material::kFabric, seed);
    hangPosters(world, wall, 0.7, random);
  }
  const double rx = 0.5 * (kRingX - kPassage);
  const double ry = 0.5 * (kRingY - kPassage);
  hangLamps(world, centre + Vector3d(0, ry, 0), {kRingX, kPassage, kRingHeight});
  hangLamps(world, centre - Vector3d(0, ry, 0), {kRingX, kPassage, kRingHeight});
  hangLamps(world, centre + Vector3d(rx, 0, 0), {kPassage, kRingY - 2 * kPassage, kRingHeight});
  hangLamps(world, centre - Vector3d(rx, 0, 0), {kPassage, kRingY - 2 * kPassage, kRingHeight});
}

// Waypoints of a closed polyline at most `step` apart, so that the rounded path stays close to it.
std::vector<Vector3d> subdivided(const std::vector<Vector3d>& corners, double step) {
  std::vector<Vector3d> points;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vector3d& a = corners[i];
    const Vector3d& b = corners[(i + 1) % corners.size()];
    const int pieces = std::max(1, static_cast<int>(std::ceil((b - a).norm() / step)));
    for (int k = 0; k < pieces; ++k) points.push_back(a + (b - a) * k / pieces);
  }
  return points;
}

}  // namespace

const char* worldName(WorldKind kind) {
  static constexpr std::array<const char*, 5> kNames{"room", "hall", "cluttered", "twin_rooms", "corridor"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::optional<WorldKind> worldNamed(const std::string& name) {
  for (const WorldKind kind : {WorldKind::kRoom, WorldKind::kHall, WorldKind::kCluttered,
                               WorldKind::kTwinRooms, WorldKind::kCorridor}) {
    if (name == worldName(kind)) return kind;
  }
  return std::nullopt;
}

Vector3d worldSize(const WorldSettings& settings) {
  const bool resizable = settings.kind == WorldKind::kRoom || settings.kind == WorldKind::kHall ||
                         settings.kind == WorldKind::kCluttered;
  if (resizable && settings.size.minCoeff() > 0) return settings.size;
  switch (settings.kind) {
    case WorldKind::kRoom:
      return {8, 8, 4};
    case WorldKind::kHall:
      return {20, 12, 7};
    case WorldKind::kCluttered:
      return {7, 7, 3.2};
    case WorldKind::kTwinRooms:
      return {2 * kTwinOffset + kTwinSide, kTwinSide + kTwinWall + kPassage, kTwinHeight};
    case WorldKind::kCorridor:
      break;
  }
  return {kRingX, kRingY, kRingHeight};
}

bool fitWorld(WorldSettings& settings, const std::vector<Vector3d>& points) {
  const bool resizable = settings.kind == WorldKind::kRoom || settings.kind == WorldKind::kHall ||
                         settings.kind == WorldKind::kCluttered;
  if (!resizable || points.empty()) return false;
  Vector3d low = points.front();
  Vector3d high = points.front();
  for (const Vector3d& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const Vector3d needed = high - low + Vector3d(2 * kWallMargin, 2 * kWallMargin, 2 * kFloorMargin);
  settings.size = worldSize(settings).cwiseMax(needed);
  settings.floor_centre = 0.5 * (low + high);
  settings.floor_centre.z() = low.z() - kFloorMargin;
  return true;
}

Tour worldTour(const WorldSettings& settings) {
  Random random(settings.seed, 45);
  const Vector3d size = worldSize(settings);
  Tour tour;
  tour.floor = settings.floor_centre.z();
  if (settings.kind == WorldKind::kTwinRooms) {
    const double south = -0.5 * kTwinSide - kTwinWall - 0.5 * kPassage;
    const double x = kTwinOffset;
    tour.waypoints = subdivided({{-x - 0.2, south, 1.3},
                                 {-x - 0.2, -1.6, 1.3},
                                 {-x - 1.4, 0, 1.6},
                                 {-x, 1.5, 1.2},
                                 {-x + 1.4, 0, 1.5},
                                 {-x + 0.2, -1.6, 1.4},
                                 {-x + 0.2, south, 1.4},
                                 {x - 0.2, south, 1.3},
                                 {x - 0.2, -1.6, 1.3},
                                 {x - 1.4, 0, 1.6},
                                 {x, 1.5, 1.2},
                                 {x + 1.4, 0, 1.5},
                                 {x + 0.2, -1.6, 1.4},
                                 {x + 0.2, south + 0.25, 1.4},
                                 {x - 0.2, south + 0.3, 1.4},
                                 {-x + 0.2, south + 0.3, 1.5}},
                                0.9);
  } else if (settings.kind == WorldKind::kCorridor) {
    const double x = 0.5 * (kRingX - kPassage);
    const double y = 0.5 * (kRingY - kPassage);
    tour.waypoints = subdivided({{x, -y, 1.3}, {x, y, 1.5}, {-x, y, 1.2}, {-x, -y, 1.6}}, 1.6);
  } else {
    const bool hall = settings.kind == WorldKind::kHall;
    const double reach_x = 0.5 * size.x() - (hall ? 2.5 : 1.6);
    const double reach_y = 0.5 * size.y() - (hall ? 2.0 : 1.6);
    const double top = hall ? 0.6 * size.z() : size.z() - 1.0;
    const int count = hall ? 14 : 10;
    for (int i = 0; i < count; ++i) {
      const double angle = 2 * std::numbers::pi * (i + random.uniform(-0.3, 0.3)) / count;
      const double share = random.uniform(0.55, 1.0);
      tour.waypoints.emplace_back(share * reach_x * std::cos(angle), share * reach_y * std::sin(angle),
                                  random.uniform(0.9, top));
    }
  }
  for (Vector3d& p : tour.waypoints) p += settings.floor_centre;
  return tour;
}

World buildWorld(const WorldSettings& settings, const std::vector<Vector3d>& keep_clear) {
  World world;
  if (settings.kind == WorldKind::kTwinRooms) {
    buildTwinRooms(world, settings, keep_clear);
  } else if (settings.kind == WorldKind::kCorridor) {
    buildCorridor(world, settings);
  } else {
    buildBoxWorld(world, settings, keep_clear);
  }
  world.finish();
  return world;
}

}  // namespace swiftlet
