# `cmake --install`: the library with its public headers, and what find_package(dqslam) reads.
# `--component library` names them where a tree has built no more than the library.

include(CMakePackageConfigHelpers)
include(GNUInstallDirs)

set(dqslam_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/dqslam)

install(
  TARGETS dqslam dqslam_costs
  EXPORT dqslamTargets
  ARCHIVE COMPONENT library
  FILE_SET HEADERS COMPONENT library)
install(
  EXPORT dqslamTargets
  NAMESPACE dqslam::
  DESTINATION ${dqslam_package_dir}
  COMPONENT library)

configure_package_config_file(
  cmake/dqslamConfig.cmake.in ${PROJECT_BINARY_DIR}/dqslamConfig.cmake
  INSTALL_DESTINATION ${dqslam_package_dir})
# Before 1.0 a minor version may change the interface.
write_basic_package_version_file(
  ${PROJECT_BINARY_DIR}/dqslamConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(
  FILES ${PROJECT_BINARY_DIR}/dqslamConfig.cmake ${PROJECT_BINARY_DIR}/dqslamConfigVersion.cmake
  DESTINATION ${dqslam_package_dir}
  COMPONENT library)
