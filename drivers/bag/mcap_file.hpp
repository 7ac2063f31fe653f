#pragma once
// Reads MCAP files: chunks uncompressed or compressed with LZ4 or zstd, messages outside of chunks, with or
// without index, finished or not. Layout: drivers/bag/mcap_records.hpp.
//
// Opening walks over the records; chunks with a message index are not decompressed. Checksums of chunks are
// verified when they are read, that of the summary when the file is opened, and that of the data only if
// messages lie outside of chunks.

#include <memory>
#include <string>

#include "drivers/bag/bag_file.hpp"

namespace swiftlet {

/// `name` names the file in messages.
[[nodiscard]] std::unique_ptr<BagFile> openMcapFile(const std::string& path, const std::string& name);

}  // namespace swiftlet
