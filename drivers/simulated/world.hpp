#pragma once
// A world of simple surfaces: rectangles, discs, upright cylinders and spheres, each with a material, a
// semantic label and an outward side, the only one that is visible.
//
// Frames: world, z up; metres. A surface point has coordinates (u, v) in metres:
//  - rectangle: origin + u u_axis + v v_axis, u in [0, u_length], v in [0, v_length]
//  - disc: the same rectangle of 2 radius by 2 radius, inside the circle touching it
//  - cylinder: u = radius azimuth (from u_axis, counter-clockwise seen from above), v = height
//  - sphere: u = radius azimuth, v = radius (latitude + 90 degrees)
// Rays are cast one by one in double precision here; the renderer has its own version.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/simulated/flight_path.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet {

enum class Shape : std::uint8_t { kRectangle, kDisc, kCylinder, kSphere };

/// Semantic classes; the values appear in labels.csv and in the label images.
enum class Label : std::uint8_t {
  kUnknown,
  kFloor,
  kCeiling,
  kWall,
  kPillar,
  kShelf,
  kTable,
  kChair,
  kBox,
  kPoster,
  kMachine,
  kBall,
  kBarrel,
  kLamp,
};
inline constexpr std::size_t kLabelCount = 14;
const char* labelName(Label label);

enum class Material : std::uint8_t {
  kPlaster,
  kBrick,
  kTiles,
  kParquet,
  kWood,
  kConcrete,
  kBooks,
  kPoster,
  kCarton,
  kChecker,
  kMetal,
  kCarpet,
  kFabric,
  kLamp,
};

struct Patch {
  Shape shape = Shape::kRectangle;
  Label label = Label::kUnknown;
  Material material = Material::kPlaster;
  std::uint8_t zone = 0;         ///< lit only by lamps of the same zone
  std::uint32_t paint_seed = 0;  ///< equal seeds, sizes and materials look equal
  Eigen::Vector3d origin =
      Eigen::Vector3d::Zero();  ///< corner; foot of a cylinder's axis; centre of a sphere
  Eigen::Vector3d u_axis = Eigen::Vector3d::UnitX();
  Eigen::Vector3d v_axis = Eigen::Vector3d::UnitY();
  double u_length = 1;  ///< m, extent of u
  double v_length = 1;  ///< m, extent of v
  double radius = 0;    ///< m, except for rectangles

  [[nodiscard]] Eigen::Vector3d pointAt(double u, double v) const;
  [[nodiscard]] Eigen::Vector3d normalAt(double u, double v) const;  ///< unit, outward
  [[nodiscard]] double area() const;
};

struct SurfacePoint {
  std::size_t patch = 0;
  double u = 0;
  double v = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
};

struct RayHit {
  std::size_t patch = 0;
  double distance = 0;  ///< in multiples of the direction's length
  double u = 0;
  double v = 0;
};

struct Lamp {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double power = 1;  ///< relative
  std::uint8_t zone = 0;
};

struct MeshTriangle {
  std::array<std::uint32_t, 3> vertex{};  ///< counter-clockwise seen from the visible side
  Label label = Label::kUnknown;
};
struct SurfaceMesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<MeshTriangle> triangles;
};

class World {
 public:
  /// Call finish() after the last add().
  void add(const Patch& patch) {
    patches_.push_back(patch);
    patches_.back().zone = zone_;
  }
  void addLamp(const Lamp& lamp) {
    lamps_.push_back(lamp);
    lamps_.back().zone = zone_;
  }
  /// Sets the zone of everything added afterwards.
  void setZone(std::uint8_t zone) { zone_ = zone; }
  void finish();

  [[nodiscard]] const std::vector<Patch>& patches() const { return patches_; }
  [[nodiscard]] const std::vector<Lamp>& lamps() const { return lamps_; }

  /// Nearest hit of a visible side between `nearest` and `farthest`, in multiples of the direction's length.
  [[nodiscard]] std::optional<RayHit> castRay(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                              double nearest, double farthest) const;
  /// Whether nothing is between the two points; both sides of surfaces count. The last `slack` [m] at either
  /// end are ignored.
  [[nodiscard]] bool sees(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double slack = 0.01) const;

  /// A random point, uniform by area.
  [[nodiscard]] SurfacePoint drawPoint(Random& random) const;

  /// The surface as triangles; round shapes to within `tolerance` [m].
  [[nodiscard]] SurfaceMesh mesh(double tolerance = 0.002) const;

  /// Radius of a patch's bounding sphere and its centre.
  struct Bound {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    double radius = 0;
  };
  [[nodiscard]] const std::vector<Bound>& bounds() const { return bounds_; }

 private:
  std::vector<Patch> patches_;
  std::vector<Bound> bounds_;
  std::vector<double> cumulative_area_;
  std::vector<Lamp> lamps_;
  std::uint8_t zone_ = 0;
};

enum class WorldKind : std::uint8_t {
  kRoom,       ///< 8 x 8 x 4 m, furnished along the walls
  kHall,       ///< 20 x 12 x 7 m, machines and stacks
  kCluttered,  ///< 7 x 7 x 3.2 m, full of things on all sides
  kTwinRooms,  ///< two rooms of 6 x 6 x 3 m, painted and lit alike, joined by a corridor
  kCorridor,   ///< a ring of corridors, 14 x 10 m outside, 2.2 m wide
};
const char* worldName(WorldKind kind);
std::optional<WorldKind> worldNamed(const std::string& name);

struct WorldSettings {
  WorldKind kind = WorldKind::kRoom;
  std::uint64_t seed = 1;
  double clutter = 1.0;  ///< scales the number of objects
  /// Size [m]; zero: the default of the kind. Only kRoom, kHall and kCluttered can be resized.
  Eigen::Vector3d size = Eigen::Vector3d::Zero();
  Eigen::Vector3d floor_centre = Eigen::Vector3d::Zero();
};

/// Size of a world as built.
Eigen::Vector3d worldSize(const WorldSettings& settings);

/// Sets size and position of a resizable world so that it contains these points with a margin to its walls.
/// False if the kind cannot be resized and does not contain them.
bool fitWorld(WorldSettings& settings, const std::vector<Eigen::Vector3d>& points);

/// The closed path offered by this world.
Tour worldTour(const WorldSettings& settings);

/// Builds the world; nothing is placed within half a metre of the points in `keep_clear`.
World buildWorld(const WorldSettings& settings, const std::vector<Eigen::Vector3d>& keep_clear);

}  // namespace swiftlet
