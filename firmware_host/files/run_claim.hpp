#pragma once
// Ownership of a run folder, and which files may be removed from it.
//
// A run writes `swiftlet_run.txt` into its folder, with the kind of the run as a word. A later run replaces
// the files of an earlier one of its kind. Files of a flight or of another kind, and files with a run's names
// in a folder without that mark, are replaced only on request. No run is written into a log. Only files with
// the names of a run's files are ever removed; other files in the folder stay. Errors: InputError with the
// folder or file, the reason and the remedy. Host side.

#include <cstdint>
#include <ctime>
#include <optional>
#include <string>
#include <vector>

namespace swiftlet {

/// The last three are of `swiftlet mesh`, `fuse` and `place`.
enum class RunKind { kReplay, kFlight, kMesh, kMap, kPlaceList };

inline constexpr const char* kRunMark = "swiftlet_run.txt";

/// The mark in a folder; none: not a run of this program, or one from before there was a mark.
std::optional<RunKind> runKindOf(const std::string& folder);

/// InputError if a run of this kind must not be written to the folder. Nothing is made or changed.
void refuseRunIn(const std::string& folder, RunKind kind = RunKind::kFlight);

/// A folder that belongs to one run until this goes: a flight's is not deleted to free space meanwhile.
class RunClaim {
 public:
  /// Makes the folder (its parents too) and removes what an earlier run left. A flight refuses a folder with
  /// a run in it, other kinds one with a run of another kind or with foreign files of their names, unless
  /// `replace`.
  RunClaim(const std::string& folder, RunKind kind, bool replace);
  RunClaim(const RunClaim&) = delete;
  RunClaim& operator=(const RunClaim&) = delete;
  ~RunClaim();

 private:
  int mark_ = -1;
};

/// "000012_20261123T160412Z"; without the time where the clock has not been set.
std::string flightName(std::uint32_t number, std::time_t now);

/// Makes a new folder in `parent` for one flight, numbered one above the largest there, and returns its path.
/// Two at once get two.
std::string makeFlightFolder(const std::string& parent, std::time_t now);

/// Deletes the oldest flights in `parent` until `bytes` are free: folders named by flightName() with a
/// flight's mark, not `current`, none that a running flight claims. Returns a line for each, and one where it
/// was not enough. Never throws.
std::vector<std::string> freeOldFlights(const std::string& parent, std::uint64_t bytes,
                                        const std::string& current);

/// Removes the meshes of an earlier run from a `meshes` folder, and nothing else.
void removeMeshes(const std::string& folder);

}  // namespace swiftlet
