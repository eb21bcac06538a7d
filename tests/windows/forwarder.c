/* python3.dll: has no code, because the linker hands each of its names on to python311.dll. */
int __stdcall DllMainCRTStartup(void *module, unsigned reason, void *reserved) {
  (void)module;
  (void)reason;
  (void)reserved;
  return 1;
}
