@ The inner loops for Armv8.1-M with the vector extension (MVE, "Helium"): eight samples in a
@ register.
@
@ C calling convention. Pointers need only a sample's alignment: VLDRH and VSTRH ask for no more.
@ Only the elements named are read or written. `.cfi` lines state the depth of the stack. Beats of
@ loads and of multiplications can overlap, so they take turns. QEMU counts LE and LETP as an
@ instruction each time.

    .syntax unified
    .cpu    cortex-m55          @ whatever processor the crate is compiled for
    .cfi_sections .debug_frame

@ void echoloop_correlate_short(const i16 *taps, usize count, const i16 *x, i16 *y, usize eights)
@
@ y[n] = saturate((Σ taps[k] · x[n + k] + 2^14) >> 15)    k = 0..count − 1,  n = 0..8·eights − 1
@
@ count ≤ 15, eights ≥ 1. Reads taps[0 .. count] and x[0 .. 8·eights + 14], writes
@ y[0 .. 8·eights].
@
@ The taps stay in registers, once as they are and once a sample later: so two outputs share their
@ samples. Sums are exact: with Σ abs(taps) ≤ 1 (Q1.15) they stay within 2^30.

x       .req r2             @ running
y       .req r3             @ running

@ Outputs n and n + 1, which begin at x + `bytes`, to two even registers.
.macro echoloop_two_outputs bytes, this, next
    vldrh.u16       q4, [x, #\bytes]
    vmladav.s16     \this, q4, q0
    vldrh.u16       q5, [x, #\bytes + 16]
    vmladav.s16     \next, q4, q2
    vmladava.s16    \this, q5, q1
    vmladava.s16    \next, q5, q3
.endm

    .section .text.echoloop_correlate_short, "ax", %progbits
    .global echoloop_correlate_short
    .type   echoloop_correlate_short, %function
    .thumb_func
    .p2align 2
echoloop_correlate_short:
    .cfi_startproc
    ldr     r12, [sp]
    push    {r4-r10, lr}
    vpush   {d8-d15}
    .cfi_def_cfa_offset 96
    .cfi_offset lr, -4
    vctp.16 r1
    vpst
    vldrht.u16  q0, [r0]            @ zeros where there are no taps
    subs    r1, #8
    it      lo
    movlo   r1, #0
    vctp.16 r1
    vpst
    vldrht.u16  q1, [r0, #16]
    mov     r4, #0
    vmov    q2, q0
    vshlc   q2, r4, #16             @ a sample later
    vmov    q3, q1
    vshlc   q3, r4, #16
    dls     lr, r12
1:  echoloop_two_outputs 0, r4, r6
    echoloop_two_outputs 4, r8, r10
    echoloop_two_outputs 8, r0, r12
    vmov    q6[2], q6[0], r4, r0    @ even outputs
    vmov    q7[2], q7[0], r6, r12   @ odd ones
    echoloop_two_outputs 12, r4, r6
    vmov    q6[3], q6[1], r8, r4
    vmov    q7[3], q7[1], r10, r6
    add     x, #16
    vqrshrnb.s32    q6, q6, #15
    vqrshrnt.s32    q6, q7, #15
    vstrh.16        q6, [y], #16
    le      lr, 1b
    vpop    {d8-d15}
    pop     {r4-r10, pc}
    .cfi_endproc
    .size   echoloop_correlate_short, . - echoloop_correlate_short

    .unreq x
    .unreq y

@ void echoloop_correlate_long(const i16 *taps, const i16 *x, i16 *y, usize eights, usize vectors)
@
@ y[n] = saturate((Σ taps[k + 1] · x[n + k] + 2^14) >> 15)
@        k = 0..8·vectors − 2,  n = 0..8·eights − 1
@
@ eights ≥ 1, vectors ≥ 2, taps[0] = taps[8·vectors] = 0. Reads taps[0 .. 8·vectors + 1] and
@ x[0 .. 8·(eights + vectors) − 2], writes y[0 .. 8·eights].
@
@ Eight sums stay in registers while taps and samples pass by: those of multiplications are the
@ even ones, so counters are odd and no register is left for LE.

taps    .req r1             @ running
x       .req r3             @ running
y       .req r5             @ running
count   .req r7             @ running
more    .req r9             @ vectors − 1
eights  .req r11            @ running

@ Eight taps for eight outputs. `sum` is vmladav for the first, vmladava for others.
.macro echoloop_eight_taps sum
    vldrh.u16   q0, [taps, #2]
    vldrh.u16   q2, [x, #4]
    vldrh.u16   q1, [taps], #16     @ a sample later
    \sum\().s16 r4, q2, q0
    vldrh.u16   q3, [x, #8]
    \sum\().s16 r6, q2, q1
    \sum\().s16 r8, q3, q0
    vldrh.u16   q2, [x, #12]
    \sum\().s16 r10, q3, q1
    \sum\().s16 r12, q2, q0
    vldrh.u16   q3, [x], #16
    \sum\().s16 lr, q2, q1
    \sum\().s16 r0, q3, q0
    \sum\().s16 r2, q3, q1
.endm

    .section .text.echoloop_correlate_long, "ax", %progbits
    .global echoloop_correlate_long
    .type   echoloop_correlate_long, %function
    .thumb_func
    .p2align 2
echoloop_correlate_long:
    .cfi_startproc
    push    {r4-r11, lr}
    .cfi_def_cfa_offset 36
    .cfi_offset lr, -4
    ldr     more, [sp, #36]
    mov     eights, r3
    mov     y, r2
    mov     x, r1
    mov     taps, r0
    subs    more, #1
1:  echoloop_eight_taps vmladav
    mov     count, more
2:  echoloop_eight_taps vmladava
    subs    count, #1
    bne     2b
    vmov    q0[2], q0[0], r0, r8    @ even outputs
    vmov    q0[3], q0[1], r4, r12
    vmov    q1[2], q1[0], r2, r10   @ odd ones
    vmov    q1[3], q1[1], r6, lr
    sub     taps, taps, more, lsl #4
    sub     taps, #16
    sub     x, x, more, lsl #4      @ eight samples further than it began
    vqrshrnb.s32    q0, q0, #15
    vqrshrnt.s32    q0, q1, #15
    vstrh.16        q0, [y], #16
    subs    eights, #1
    bne     1b
    pop     {r4-r11, pc}
    .cfi_endproc
    .size   echoloop_correlate_long, . - echoloop_correlate_long

    .unreq taps
    .unreq x
    .unreq y
    .unreq count
    .unreq more
    .unreq eights

@ void echoloop_count_above(const u16 *codes, usize count, u32 centre, u32 *bounds)
@
@ Replaces each of bounds[0 .. 4], all below 2^16, by the number of codes[0 .. count] that lie
@ further from the centre than that bound.

    .section .text.echoloop_count_above, "ax", %progbits
    .global echoloop_count_above
    .type   echoloop_count_above, %function
    .thumb_func
    .p2align 2
echoloop_count_above:
    .cfi_startproc
    push    {r4-r11, lr}
    .cfi_def_cfa_offset 36
    .cfi_offset lr, -4
    ldrd    r5, r7, [r3]
    ldrd    r9, r11, [r3, #8]
    vdup.16     q1, r2
    vmov.i16    q2, #1
    mov     r4, #0
    mov     r6, #0
    mov     r8, #0
    mov     r10, #0
    wlstp.16    lr, r1, 2f
1:  vldrh.u16   q0, [r0], #16
    vabd.u16    q0, q0, q1
    vpt.u16     hi, q0, r5
    vaddvat.u16 r4, q2
    vpt.u16     hi, q0, r7
    vaddvat.u16 r6, q2
    vpt.u16     hi, q0, r9
    vaddvat.u16 r8, q2
    vpt.u16     hi, q0, r11
    vaddvat.u16 r10, q2
    letp    lr, 1b
2:  strd    r4, r6, [r3]
    strd    r8, r10, [r3, #8]
    pop     {r4-r11, pc}
    .cfi_endproc
    .size   echoloop_count_above, . - echoloop_count_above

@ usize echoloop_first_reaching(const i16 *values, usize count, i32 threshold)
@
@ Returns the index of the first of values[0 .. count] that is not below the threshold; `count` when
@ all are below.

    .section .text.echoloop_first_reaching, "ax", %progbits
    .global echoloop_first_reaching
    .type   echoloop_first_reaching, %function
    .thumb_func
    .p2align 2
echoloop_first_reaching:
    .cfi_startproc
    push    {r4, lr}
    .cfi_def_cfa_offset 8
    .cfi_offset lr, -4
    mov     r4, r0
    wlstp.16    lr, r1, 2f
1:  vldrh.u16   q0, [r0], #16
    vcmp.s16    ge, q0, r2
    vmrs    r3, p0              @ two bits a sample, as it has two bytes
    cbnz    r3, 3f
    letp    lr, 1b
2:  mov     r0, r1
    pop     {r4, pc}
3:  lctp                        @ the loop ends before its last round
    rbit    r3, r3
    clz     r3, r3
    sub     r0, #16
    sub     r0, r4
    add     r0, r3
    lsr     r0, #1
    pop     {r4, pc}
    .cfi_endproc
    .size   echoloop_first_reaching, . - echoloop_first_reaching
