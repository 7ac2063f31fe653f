#!/bin/sh
# Builds the sandbox's kernel from Debian's source into build/kernel_sandbox/linux: 7 minutes on two cores, 2 GB.
# usage: toolchain/kernel_sandbox/build_kernel.sh [FOLDER]   FOLDER instead of build/kernel_sandbox
# Needs: apt-get install linux-source-6.1 gcc make flex bison bc libelf-dev xz-utils patch
#   LINUX_SOURCE   the archive, where it is not /usr/src/linux-source-6.1.tar.xz
set -eu
here=$(cd "$(dirname "$0")" && pwd)
folder=${1:-$here/../../build/kernel_sandbox}
archive=${LINUX_SOURCE:-/usr/src/linux-source-6.1.tar.xz}
if [ ! -f "$archive" ]; then
  echo "build_kernel: $archive is missing; apt-get install linux-source-6.1" >&2
  exit 2
fi
for tool in gcc make flex bison bc xz patch; do
  command -v $tool >/dev/null || {
    echo "build_kernel: $tool is missing; the packages stand at the top of $0" >&2
    exit 2
  }
done

mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
rm -rf "$folder/source"
mkdir "$folder/source"
tar -xf "$archive" -C "$folder/source" --strip-components=1
cd "$folder/source"
patch -p1 -s <"$here/kernel.patch"
export ARCH=um
make -s x86_64_defconfig
./scripts/kconfig/merge_config.sh -m .config "$here/kernel.config" >"$folder/config.log"
make -s olddefconfig
# What Debian's source cannot offer would otherwise show in a test that fails for no reason.
grep '=y$' "$here/kernel.config" | while read -r option; do
  grep -qx "$option" .config || echo "build_kernel: not taken: $option" >&2
done
make -s -j"$(nproc)" linux
strip -o "$folder/linux" linux
cd "$folder"
rm -rf source
ls -l linux
