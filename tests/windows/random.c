/* bcryptprimitives.dll: random bytes for programs in Rust, because Wine 8 lacks this library. */
#include <windows.h>

BOOLEAN NTAPI SystemFunction036(PVOID bytes, ULONG count);

__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE bytes, SIZE_T count) {
  for (SIZE_T done = 0; done < count; done += 65536) {
    SIZE_T rest = count - done;
    SystemFunction036(bytes + done, (ULONG)(rest < 65536 ? rest : 65536));
  }
  return TRUE;
}
