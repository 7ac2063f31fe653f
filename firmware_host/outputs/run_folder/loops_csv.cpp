#include "firmware_host/outputs/run_folder/loops_csv.hpp"

#include <fmt/format.h>

#include <array>

#include "drivers/recorded/csv_reader.hpp"
#include "drivers/recorded/parse_number.hpp"
#include "firmware_host/files/whole_file.hpp"

namespace swiftlet {
namespace {

constexpr std::array<LoopVerdict, kLoopVerdicts> kVerdicts = {
    LoopVerdict::kSelected,    LoopVerdict::kAgainstOdometry, LoopVerdict::kInconsistent,
    LoopVerdict::kUnsupported, LoopVerdict::kReleased,        LoopVerdict::kAgainstSolution};
constexpr std::size_t kVerdictField = 2;
constexpr std::size_t kFirstNumber = 3;
constexpr std::size_t kLoopNumbers = 10;

}  // namespace

std::string_view verdictName(LoopVerdict verdict) {
  switch (verdict) {
    case LoopVerdict::kSelected:
      return "selected";
    case LoopVerdict::kAgainstOdometry:
      return "against_odometry";
    case LoopVerdict::kInconsistent:
      return "inconsistent";
    case LoopVerdict::kUnsupported:
      return "unsupported";
    case LoopVerdict::kReleased:
      return "released";
    case LoopVerdict::kAgainstSolution:
      return "against_solution";
  }
  return "unknown";
}

void writeLoops(const std::string& path, std::span<const MapLoop> loops) {
  WholeFile file(path);
  file.write(
      "#old [ns],new [ns],verdict,inliers,p_x [m],p_y [m],p_z [m],q_x [],q_y [],q_z [],q_w [],"
      "sigma_rotation [rad],sigma_translation [m]\n");
  for (const MapLoop& loop : loops) {
    const Eigen::Vector3d& p = loop.T_old_new.translation;
    const Eigen::Quaterniond& q = loop.T_old_new.rotation;
    file.write(fmt::format("{},{},{},{},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.4g},{:.4g}\n",
                           loop.old_stamp.ns, loop.new_stamp.ns, verdictName(loop.verdict), loop.inliers,
                           p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w(), loop.rotation_sigma,
                           loop.translation_sigma));
  }
  file.commit();
}

std::vector<MapLoop> readLoops(const std::string& path) {
  LogCounters counters;
  LogWarnings warnings;
  CsvReader csv(path, CsvReader::Separator::kComma, counters, warnings);
  constexpr std::array<const char*, kLoopNumbers> kNames = {
      "inliers", "p_x", "p_y", "p_z", "q_x", "q_y", "q_z", "q_w", "sigma_rotation", "sigma_translation"};
  std::vector<MapLoop> loops;
  while (csv.next(kFirstNumber + kLoopNumbers)) {
    MapLoop loop;
    if (!parseNanoseconds(csv.field(0), loop.old_stamp) || !parseNanoseconds(csv.field(1), loop.new_stamp)) {
      csv.reject("stamp", "not a stamp in ns");
      continue;
    }
    const auto* verdict = std::find_if(kVerdicts.begin(), kVerdicts.end(), [&](LoopVerdict v) {
      return verdictName(v) == csv.field(kVerdictField);
    });
    if (verdict == kVerdicts.end()) {
      csv.reject("verdict", "not a verdict of the selection");
      continue;
    }
    std::array<double, kLoopNumbers> v{};
    if (!csv.numbers(kFirstNumber, kNames, v.data())) continue;
    loop.verdict = *verdict;
    loop.inliers = static_cast<std::size_t>(std::max(v[0], 0.0));
    loop.T_old_new = SE3(Eigen::Quaterniond(v[7], v[4], v[5], v[6]), {v[1], v[2], v[3]});
    loop.rotation_sigma = v[8];
    loop.translation_sigma = v[9];
    loops.push_back(loop);
  }
  return loops;
}

}  // namespace swiftlet
