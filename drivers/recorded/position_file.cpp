#include "drivers/recorded/position_file.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <optional>

#include "drivers/recorded/csv_reader.hpp"
#include "drivers/recorded/order_by_stamp.hpp"
#include "drivers/recorded/parse_number.hpp"
#include "estimator/core/units.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kPoseFields = 8;
constexpr double kSecondsBelow = 1e11;

/// Earth-centred coordinates [m] of latitude [deg], longitude [deg], height [m].
Eigen::Vector3d earthCentred(const Eigen::Vector3d& geodetic) {
  constexpr double kSemiMajor = 6378137.0;  // m, WGS 84
  constexpr double kFlattening = 1 / 298.257223563;
  constexpr double kEccentricity2 = kFlattening * (2 - kFlattening);
  const double latitude = geodetic.x() / kToDegrees;
  const double longitude = geodetic.y() / kToDegrees;
  const double s = std::sin(latitude);
  const double radius = kSemiMajor / std::sqrt(1 - kEccentricity2 * s * s);
  const double across = (radius + geodetic.z()) * std::cos(latitude);
  return {across * std::cos(longitude), across * std::sin(longitude),
          (radius * (1 - kEccentricity2) + geodetic.z()) * s};
}

/// Column names of a header in lower case, letters only and without units.
std::vector<std::string> columnsOf(const std::string& header) {
  std::vector<std::string> columns = {""};
  for (const char c : header) {
    if (c == ',' || c == '\t') {
      columns.emplace_back();
    } else if (std::isalpha(static_cast<unsigned char>(c)) != 0) {
      columns.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    } else if (c == '[' || c == '(') {
      columns.back() += ' ';  // the unit follows
    }
  }
  for (std::string& column : columns) column = column.substr(0, column.find(' '));
  return columns;
}

std::optional<std::size_t> find(const std::vector<std::string>& columns,
                                std::initializer_list<std::string_view> names) {
  const auto found = std::ranges::find_if(
      columns, [&](const std::string& column) { return std::ranges::find(names, column) != names.end(); });
  if (found == columns.end()) return std::nullopt;
  return static_cast<std::size_t>(found - columns.begin());
}

/// Columns of a row's three coordinates.
struct Columns {
  explicit Columns(const std::string& header) {
    const std::vector<std::string> names = columnsOf(header);
    const auto latitude = find(names, {"lat", "latitude"});
    const auto longitude = find(names, {"lon", "lng", "longitude"});
    const auto height = find(names, {"alt", "altitude", "height", "ele", "elevation", "h"});
    if (!latitude || !longitude || !height) return;
    at = {*latitude, *longitude, *height};
    geodetic = true;
  }
  [[nodiscard]] std::size_t fields() const { return *std::ranges::max_element(at) + 1; }

  std::array<std::size_t, 3> at = {1, 2, 3};
  bool geodetic = false;
};

bool readStamp(CsvReader& csv, Stamp& stamp) {
  const std::string_view field = csv.field(0);
  double value = 0;
  const bool seconds = parseDouble(field, value) && std::abs(value) < kSecondsBelow;
  if (seconds ? parseSeconds(field, stamp) : parseCsvStamp(field, stamp)) return true;
  csv.reject("timestamp", quoteInput(field) + " is not a stamp in s or ns");
  return false;
}

std::vector<PositionPoint> readRows(CsvReader& csv, LogCounters& counters, LogWarnings& warnings) {
  std::vector<PositionPoint> points;
  std::optional<Columns> columns;
  std::optional<Eigen::Vector3d> origin;
  while (csv.next(columns ? columns->fields() : 1)) {
    if (!columns) columns.emplace(csv.header());
    const auto& names =
        columns->geodetic ? std::array{"latitude", "longitude", "height"} : std::array{"x", "y", "z"};
    PositionPoint point;
    bool good = csv.size() >= columns->fields();
    if (!good) csv.reject("row", "has fewer columns than a stamp and a position need");
    good = good && readStamp(csv, point.stamp);
    for (int i = 0; good && i < 3; ++i) {
      const auto axis = static_cast<std::size_t>(i);
      good = csv.number(columns->at[axis], names[axis], point.p[i]);
    }
    if (!good) continue;
    if (columns->geodetic) {
      constexpr double kPole = 90;
      if (std::abs(point.p.x()) > kPole) {
        csv.reject("latitude", "is beyond 90 degrees");
        continue;
      }
      if (!origin) origin = point.p;
      point.p = eastNorthUp(point.p, *origin);
    }
    points.push_back(point);
  }
  csv.finish("positions",
             "Write each row as `t, x, y, z` in s (or ns) and m, or name lat, lon and alt in the header");
  orderByStamp(points, csv.name(), counters, warnings);
  return points;
}

}  // namespace

Eigen::Vector3d eastNorthUp(const Eigen::Vector3d& geodetic, const Eigen::Vector3d& origin) {
  const double latitude = origin.x() / kToDegrees;
  const double longitude = origin.y() / kToDegrees;
  const Eigen::Vector3d east(-std::sin(longitude), std::cos(longitude), 0);
  const Eigen::Vector3d up(std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude),
                           std::sin(latitude));
  const Eigen::Vector3d north = up.cross(east);
  const Eigen::Vector3d d = earthCentred(geodetic) - earthCentred(origin);
  return {east.dot(d), north.dot(d), up.dot(d)};
}

bool isPositionFile(const std::string& path) {
  LogCounters counters;
  LogWarnings warnings;
  CsvReader csv(path, CsvReader::separatorOf(path), counters, warnings);
  const bool any = csv.next(1);
  return any && ((csv.size() >= 4 && csv.size() < kPoseFields) || Columns(csv.header()).geodetic);
}

std::vector<PositionPoint> readPositions(const std::string& path, LogCounters& counters,
                                         LogWarnings& warnings) {
  CsvReader csv(path, CsvReader::separatorOf(path), counters, warnings);
  return readRows(csv, counters, warnings);
}

std::vector<PositionPoint> readPositionsText(const std::string& name, std::string_view text,
                                             LogCounters& counters, LogWarnings& warnings) {
  CsvReader csv(name, text, CsvReader::separatorOfText(text), counters, warnings);
  return readRows(csv, counters, warnings);
}

}  // namespace swiftlet
