# Makes a workspace of the prefix, at installation: its marker and its setup files. The prefix may be another one than what
# catkin has written into the files when it was configured.
get_filename_component(prefix "${CMAKE_INSTALL_PREFIX}" ABSOLUTE)
set(root "$ENV{DESTDIR}${prefix}")

file(APPEND "${root}/.catkin" "")
file(INSTALL "${devel_space}/_setup_util.py" "${generated}/env.sh" DESTINATION "${prefix}" USE_SOURCE_PERMISSIONS)
foreach(shell bash sh zsh)
  file(INSTALL "${generated}/setup.${shell}" "${generated}/local_setup.${shell}" DESTINATION "${prefix}")
endforeach()

foreach(file setup.sh local_setup.sh lib/pkgconfig/${package}.pc share/${package}/cmake/${package}Config.cmake)
  file(READ "${root}/${file}" text)
  # Only here: what else has this prefix, such as OpenCV in /usr/local, stays there.
  foreach(before "_SETUP_DIR:=" "prefix=" "_INSTALL_PREFIX " "foreach(path ")
    string(REPLACE "${before}${configured_prefix}" "${before}${prefix}" text "${text}")
  endforeach()
  file(WRITE "${root}/${file}" "${text}")
endforeach()
