#pragma once
// Reads EuRoC/ASL imu0/data.csv: `stamp [ns], gyro x y z [rad/s], accel x y z [m/s^2]`.
//
// Gyro first, unless the header names the accelerometer first. Rows are sorted; repeated stamps, text and NaN
// are skipped and counted; files in g or with the sensors swapped are refused. Memory: 56 bytes per sample
// (12 MB for 18 minutes at 200 Hz).

#include <string>
#include <string_view>
#include <vector>

#include "drivers/recorded/csv_reader.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

std::vector<ImuSample> readImuFile(const std::string& path, LogCounters& counters, LogWarnings& warnings);
std::vector<ImuSample> readImuText(const std::string& name, std::string_view text, LogCounters& counters,
                                   LogWarnings& warnings);

/// Reads the rows of such a file one at a time and unchanged, neither sorted nor checked for units.
class ImuRows {
 public:
  /// Both must outlive this object.
  ImuRows(CsvReader& csv, LogWarnings& warnings) : csv_(csv), warnings_(warnings) {}
  /// False at the end, where an InputError is thrown if the file holds no samples (CsvReader::finish).
  bool next(ImuSample& sample);

 private:
  CsvReader& csv_;
  LogWarnings& warnings_;
  bool any_ = false;
  bool accel_first_ = false;
};

/// Median sample rate [Hz]; 0 for fewer than two samples.
double medianRate(const std::vector<ImuSample>& samples);

/// Sorts by stamp (equal stamps keep their order) and drops repeated stamps; both are counted.
void orderSamples(std::vector<ImuSample>& samples, const std::string& name, LogCounters& counters,
                  LogWarnings& warnings);

/// Norms of the specific force without vibration. If gravity is included they are steady: `low` is close to
/// `median` in any unit. Linear acceleration repeatedly passes through zero.
struct ForceLevel {
  double median = 0;
  double low = 0;  ///< the 10 % quantile

  [[nodiscard]] bool steady() const { return low > 0.7 * median; }
  [[nodiscard]] bool inG() const { return median > 0.5 && median < 2 && steady(); }
  /// Allows for 40 % scale error and for sustained manoeuvres.
  [[nodiscard]] bool hasGravity() const { return median > 6 && median < 16; }
};
ForceLevel forceLevel(const std::vector<ImuSample>& samples);

/// Throws if the norms reveal another unit or swapped sensors.
void checkUnits(const std::vector<ImuSample>& samples, const std::string& name, LogWarnings& warnings);

}  // namespace swiftlet
