# Sanitizers for all that is compiled here: the library, the extension and the tests.

set(DQSLAM_SANITIZE "" CACHE STRING "Sanitizers to compile with: address,undefined or thread")
set_property(CACHE DQSLAM_SANITIZE PROPERTY STRINGS "" "address,undefined" "thread")

if(DQSLAM_SANITIZE)
  if(NOT DQSLAM_SANITIZE MATCHES "^(address|undefined|address,undefined|thread)$")
    message(FATAL_ERROR "DQSLAM_SANITIZE is ${DQSLAM_SANITIZE}: need address,undefined or thread")
  endif()
  if(NOT CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
    message(FATAL_ERROR "DQSLAM_SANITIZE needs GCC or Clang")
  endif()
  # For every target, because one that is not instrumented hides what it does to the others.
  add_compile_options(-fsanitize=${DQSLAM_SANITIZE} -fno-omit-frame-pointer -g)
  add_link_options(-fsanitize=${DQSLAM_SANITIZE})
  if(DQSLAM_SANITIZE MATCHES "undefined")
    add_compile_options(-fno-sanitize-recover=undefined)  # a finding fails the test
  endif()
endif()
