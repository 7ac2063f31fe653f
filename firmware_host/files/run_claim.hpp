#pragma once
// Ownership of a run folder, and which files may be removed from it.
//
// A run writes `swiftlet_run.txt` with the kind of the run into its folder. A later run replaces the files of
// an earlier one of its kind. Files of a flight or of another kind, and files with a run's names in a folder
// without that mark, are replaced only on request. No run is written into a log. Only files with the names of
// a run's files are ever removed; other files in the folder stay. Errors: InputError with the folder or file,
// the reason and the remedy. Host side.

#include <cstdint>
#include <ctime>
#include <optional>
#include <string>
#include <vector>

namespace swiftlet {

/// The last four are those of `swiftlet mesh`, `fuse`, `place`, and `calibrate cameras` and `imu-camera`.
enum class RunKind { kReplay, kFlight, kMesh, kMap, kPlaceList, kCalibration };

inline constexpr const char* kRunMark = "swiftlet_run.txt";

/// The mark in a folder; empty: not a run of this program, or an old run without a mark.
std::optional<RunKind> runKindOf(const std::string& folder);

/// InputError if a run of this kind must not be written to the folder. Changes nothing.
void refuseRunIn(const std::string& folder, RunKind kind = RunKind::kFlight);

/// Paths of the files that a claim of kind kCalibration removes from the folder.
std::vector<std::string> calibrationFilesIn(const std::string& folder);

/// A folder that belongs to one run during this object's lifetime; a flight's is not deleted to free space.
class RunClaim {
 public:
  /// Creates the folder and its parents, and removes what an earlier run left. Without `replace`, a flight
  /// refuses a folder with a run in it; other kinds refuse one with a run of another kind or with foreign
  /// files of their names.
  RunClaim(const std::string& folder, RunKind kind, bool replace);
  RunClaim(const RunClaim&) = delete;
  RunClaim& operator=(const RunClaim&) = delete;
  ~RunClaim();

 private:
  int mark_ = -1;
};

/// "000012_20261123T160412Z"; without the time if the clock is not set.
std::string flightName(std::uint32_t number, std::time_t now);

/// Makes a new folder in `parent` for one flight, numbered one above the largest there, and returns its path.
/// Concurrent calls get different folders.
std::string makeFlightFolder(const std::string& parent, std::time_t now);

/// Deletes the oldest flights in `parent` until `bytes` are free: folders named by flightName() with a
/// flight's mark, except `current` and those claimed by running flights. Returns a line for each, and one if
/// it was not enough. Never throws.
std::vector<std::string> freeOldFlights(const std::string& parent, std::uint64_t bytes,
                                        const std::string& current);

/// Removes the meshes of an earlier run from a `meshes` folder, and nothing else.
void removeMeshes(const std::string& folder);

}  // namespace swiftlet
