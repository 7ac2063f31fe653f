#pragma once
// EuRoC/ASL imu0/data.csv: `stamp [ns], gyro x y z [rad/s], accel x y z [m/s^2]`.
//
// Gyro first, unless the header names the accelerometer first. Rows are put in order, repeated stamps,
// text and NaN are skipped and counted; files in g or with the sensors swapped are refused.
// Memory: 56 bytes a sample (12 MB for 18 minutes at 200 Hz).

#include <string>
#include <string_view>
#include <vector>

#include "drivers/recorded/csv_reader.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

std::vector<ImuSample> readImuFile(const std::string& path, LogCounters& counters, LogWarnings& warnings);
std::vector<ImuSample> readImuText(const std::string& name, std::string_view text, LogCounters& counters,
                                   LogWarnings& warnings);

/// The rows of such a file one at a time and unchanged: neither sorted nor checked for units.
class ImuRows {
 public:
  /// Both outlive this.
  ImuRows(CsvReader& csv, LogWarnings& warnings) : csv_(csv), warnings_(warnings) {}
  /// False at the end; InputError there where the file holds no samples (CsvReader::finish).
  bool next(ImuSample& sample);

 private:
  CsvReader& csv_;
  LogWarnings& warnings_;
  bool any_ = false;
  bool accel_first_ = false;
};

/// Median sample rate [Hz]; 0 for fewer than two samples.
double medianRate(const std::vector<ImuSample>& samples);

/// Sorts by stamp (equal stamps keep their order) and drops repeated stamps; both counted.
void orderSamples(std::vector<ImuSample>& samples, const std::string& name, LogCounters& counters,
                  LogWarnings& warnings);

/// Norms of the specific force without vibration. If gravity is included they are steady: `low` is close to
/// `median` in any unit. Linear acceleration repeatedly passes through zero.
struct ForceLevel {
  double median = 0;
  double low = 0;  ///< below which a tenth of them is

  [[nodiscard]] bool steady() const { return low > 0.7 * median; }
  [[nodiscard]] bool inG() const { return median > 0.5 && median < 2 && steady(); }
  /// Room for 40 % of scale error and for sustained manoeuvres.
  [[nodiscard]] bool hasGravity() const { return median > 6 && median < 16; }
};
ForceLevel forceLevel(const std::vector<ImuSample>& samples);

/// Rejects samples whose norm reveals another unit or swapped sensors.
void checkUnits(const std::vector<ImuSample>& samples, const std::string& name, LogWarnings& warnings);

}  // namespace swiftlet
