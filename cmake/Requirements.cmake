# What has to be there before dqslam can be compiled; what is missing is named together with the
# line that installs it.

set(dqslam_installation_hint
    "Install what dqslam is compiled with, then try again:
  Debian, Ubuntu   sudo apt-get install g++ python3-dev libceres-dev
  Fedora           sudo dnf install gcc-c++ python3-devel ceres-solver-devel
  Arch             sudo pacman -S --needed base-devel ceres-solver
  macOS            xcode-select --install; brew install ceres-solver
  conda            conda install -c conda-forge cxx-compiler eigen ceres-solver
docs/installation.md says more; a binary wheel of dqslam needs none of these.")

function(dqslam_fail what)
  # CMake rewraps lines that start in the first column: indented ones stay as they are.
  string(REPLACE "\n" "\n  " hint "  ${dqslam_installation_hint}")
  message(FATAL_ERROR "  ${what}\n${hint}")
endfunction()

macro(dqslam_require_compiler)
  include(CheckLanguage)
  check_language(CXX)
  if(NOT CMAKE_CXX_COMPILER)
    dqslam_fail("No C++ compiler was found.")
  endif()
  enable_language(CXX)
endmacro()

# Any newer version serves: asked for a version, Eigen's package would refuse the next major one.
macro(dqslam_require package version)
  find_package(${package} QUIET ${ARGN})
  if(NOT ${package}_FOUND)
    dqslam_fail("${package} ${version} or newer was not found.")
  elseif(${package}_VERSION VERSION_LESS ${version})
    dqslam_fail("${package} ${version} or newer is needed, but this is ${${package}_VERSION}.")
  endif()
endmacro()
