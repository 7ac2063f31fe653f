#!/bin/sh
# Unpacks Debian's arm64 packages, with their dependencies, into a folder that the cross build looks for headers and
# libraries in, and that qemu runs programs with. Nothing of this machine's own packages changes: no foreign
# architecture is added to dpkg. As any user.
# usage: toolchain/aarch64/make_root.sh [FOLDER]   default build/arm64_root; some 2 GiB
# Needs apt and a network. A folder that is there is made anew only where the list of packages changed.
set -eu
cd "$(dirname "$0")/../.."
list=toolchain/aarch64/packages.txt
root=${1:-build/arm64_root}
mkdir -p "$root"
root=$(cd "$root" && pwd)
if cmp -s "$list" "$root/packages.txt"; then
  echo "make_root: $root has all of $list"
  exit 0
fi

# An apt of its own: this machine's sources and keys, an empty list of installed packages.
apt=$root/apt
mkdir -p "$apt/lists/partial" "$apt/archives/partial"
: >"$apt/status"
foreign_apt() {
  apt-get -o APT::Architecture=arm64 -o APT::Architectures::=arm64 -o Dir::State::lists="$apt/lists" \
    -o Dir::State::status="$apt/status" -o Dir::State::extended_states="$apt/extended_states" \
    -o Dir::Cache="$apt" -o Dir::Cache::archives="$apt/archives" -o Debug::NoLocking=true \
    -o APT::Get::AllowUnauthenticated=false -o Acquire::Languages=none -o APT::Sandbox::User="$(id -un)" "$@"
}
echo "make_root: lists of packages"
foreign_apt update -qq
echo "make_root: packages"
# shellcheck disable=SC2046 # a list of names, one argument each
foreign_apt install -y -qq --no-install-recommends --download-only $(sed -e 's/#.*//' "$list") >"$apt/download.log"

echo "make_root: unpacking $(find "$apt/archives" -name '*.deb' | wc -l) packages into $root"
for folder in bin sbin lib; do
  mkdir -p "$root/usr/$folder"
  [ -e "$root/$folder" ] || ln -s "usr/$folder" "$root/$folder"
done
for deb in "$apt"/archives/*.deb; do
  # Pages and texts are no use here. /lib stays the link that it is.
  dpkg-deb --fsys-tarfile "$deb" | tar -x -C "$root" --keep-directory-symlink --no-same-owner \
    --exclude='./usr/share/doc' --exclude='./usr/share/man' --exclude='./usr/share/locale' --exclude='./dev'
done

# What packages do when they are installed: links that name one of several BLAS.
libraries=$root/usr/lib/aarch64-linux-gnu
for name in blas lapack; do
  for file in "$libraries/$name"/lib$name.so*; do
    [ -e "$file" ] && ln -sf "$name/$(basename "$file")" "$libraries/"
  done
done
# Links to absolute names would lead out of the folder.
find "$root/usr" "$root/etc" -type l -lname '/*' | while read -r link; do
  target=$(readlink "$link")
  ln -sfn "$(realpath -ms --relative-to="$(dirname "$link")" "$root$target")" "$link"
done
# One package names its files by absolute paths; the others find them from where they stand.
sed -i -e "s,\"/usr\",\"$root/usr\",g" -e "s,\"/usr/,\"$root/usr/,g" "$libraries"/cmake/libjpeg-turbo/libjpeg-turboTargets*.cmake
rm -rf "$apt"
cp "$list" "$root/packages.txt"
echo "make_root: $(du -sh "$root" | cut -f1) in $root"
